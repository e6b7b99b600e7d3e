//! Functions of libm whose calls are counted. They call symbols that `counters.rs` of the program defines.
#![no_std]

pub use real;
pub use real::*;

macro_rules! counted {
    ($($name:ident($($argument:ident),+) = $counted:ident;)+) => {
        unsafe extern "C" { $(fn $counted($($argument: f32),+) -> f32;)+ }
        $(
            /// Function of libm, counted at its call.
            #[inline(always)]
            pub fn $name($($argument: f32),+) -> f32 {
                // SAFETY: the program defines the function, which computes what libm's does.
                unsafe { $counted($($argument),+) }
            }
        )+
    };
}

counted! {
    sqrtf(x) = counted_sqrtf;
    floorf(x) = counted_floorf;
    ceilf(x) = counted_ceilf;
    sinf(x) = counted_sinf;
    cosf(x) = counted_cosf;
    expf(x) = counted_expf;
    powf(x, y) = counted_powf;
    atan2f(y, x) = counted_atan2f;
}

/// Sine and cosine, counted as two calls.
#[inline(always)]
pub fn sincosf(x: f32) -> (f32, f32) {
    (sinf(x), cosf(x))
}
