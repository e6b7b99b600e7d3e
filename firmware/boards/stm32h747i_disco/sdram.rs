//! Pins and timing of external memory (ST, "UM2411", schematic MB1248, `STM32CubeH7`; ISSI, "IS42S32800").

use stm32_fmc::Sdram;
use stm32_fmc::devices::is42s32800g_6::Is42s32800g;
use stm32h7xx_hal::gpio::{Speed, gpiod, gpioe, gpiof, gpiog, gpioh, gpioi};
use stm32h7xx_hal::pac::FMC;
use stm32h7xx_hal::prelude::*;
use stm32h7xx_hal::rcc::{CoreClocks, rec};

/// GPIO ports with the pins of external memory.
pub(crate) struct Ports {
    pub(crate) d: gpiod::Parts,
    pub(crate) e: gpioe::Parts,
    pub(crate) f: gpiof::Parts,
    pub(crate) g: gpiog::Parts,
    pub(crate) h: gpioh::Parts,
    pub(crate) i: gpioi::Parts,
}

macro_rules! pins {
    ($($pin:expr),* $(,)?) => {
        ($($pin.into_push_pull_output().speed(Speed::VeryHigh).into_alternate::<12>().internal_pull_up(true)),*)
    };
}

/// Configures pins and creates the controller of external memory; `init` starts it.
pub(crate) fn controller(
    fmc: FMC,
    Ports { d, e, f, g, h, i }: Ports,
    reset: rec::Fmc,
    clocks: &CoreClocks,
) -> Sdram<stm32h7xx_hal::fmc::FMC, Is42s32800g> {
    #[rustfmt::skip]
    let pins = pins![
        // Address, bank.
        f.pf0, f.pf1, f.pf2, f.pf3, f.pf4, f.pf5, f.pf12, f.pf13, f.pf14, f.pf15, g.pg0, g.pg1, g.pg4, g.pg5,
        // Data.
        d.pd14, d.pd15, d.pd0, d.pd1, e.pe7, e.pe8, e.pe9, e.pe10, e.pe11, e.pe12, e.pe13, e.pe14,
        e.pe15, d.pd8, d.pd9, d.pd10, h.ph8, h.ph9, h.ph10, h.ph11, h.ph12, h.ph13, h.ph14, h.ph15,
        i.pi0, i.pi1, i.pi2, i.pi3, i.pi6, i.pi7, i.pi9, i.pi10,
        // Byte masks.
        e.pe0, e.pe1, i.pi4, i.pi5,
        // SDCKE1, SDCLK, SDNCAS, SDNE1, SDNRAS, SDNWE.
        h.ph7, g.pg8, g.pg15, h.ph6, f.pf11, h.ph5,
    ];
    fmc.sdram(pins, Is42s32800g {}, reset, clocks)
}
