//! Parts of boards that need no hardware: the ring buffer between a UART's interrupt and the port, and the
//! sizes in docs/bring-up.md.

use photoncard_firmware::kind::MICRO;
use photoncard_firmware::serve::Ring;

/// docs/bring-up.md states the sizes of the micro chip's budget.
#[test]
fn the_page_states_the_budget() {
    let page = include_str!("../../../docs/bring-up.md");
    for (name, bytes, unit, shift) in [
        ("dram_bytes", MICRO.dram_bytes, "MB", 20),
        ("sram_bytes", MICRO.sram_bytes.into(), "KB", 10),
        ("stack_bytes", MICRO.stack_bytes.into(), "KB", 10),
    ] {
        let row = format!("| {} {unit} | `MICRO.{name}`", bytes >> shift);
        assert!(page.contains(&row), "{row}");
    }
    let caches = (MICRO.photon_cache_bytes + MICRO.scene_cache_bytes) >> 10;
    assert!(page.contains(&format!("the {caches} KB of the budget's caches")));
}

#[test]
fn a_full_ring_refuses_and_loses_nothing() {
    let ring = Ring::<4>::new();
    let mut next = 0;
    for round in 0..100 {
        let wanted = round % 7;
        let put = (0..wanted).take_while(|&ahead| ring.put(next + ahead)).count() as u8;
        assert_eq!(put, wanted.min(4));
        assert_eq!((ring.is_full(), ring.is_empty()), (put == 4, put == 0));
        for _ in 0..put {
            assert_eq!(ring.take(), Some(next));
            next = next.wrapping_add(1);
        }
        assert_eq!(ring.take(), None);
        next %= 100;
    }
}

#[test]
fn bytes_cross_between_threads_in_order() {
    let ring = Ring::<8>::new();
    let bytes = || (0..100_000_u32).map(|number| (number % 251) as u8);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for byte in bytes() {
                while !ring.put(byte) {
                    std::thread::yield_now();
                }
            }
        });
        for byte in bytes() {
            let taken = std::iter::repeat_with(|| ring.take()).find(|taken| {
                if taken.is_none() {
                    std::thread::yield_now();
                }
                taken.is_some()
            });
            assert_eq!(taken.flatten(), Some(byte));
        }
    });
}
