//! Software floating-point operations, which a processor without floating-point instructions calls. Each is
//! counted by its kind and the position of the call. They are implemented by SSE2 instructions, which the
//! rest of the program does not use, and therefore round as on every processor.

use core::arch::global_asm;

/// Number of kinds of operations. In the order of their tables they are: additions and subtractions,
/// multiplications, divisions, square roots, comparisons, conversions, roundings to integers, and calls of
/// libm's other functions.
pub(crate) const KINDS: usize = 8;

/// Maximum size of the program's code, bytes. Each table of counts has an entry for each of these bytes.
pub(crate) const CODE_BYTES: usize = 4 << 20;

/// Counts of each kind at each position in the code.
#[unsafe(no_mangle)]
pub(crate) static mut OPERATION_COUNTS: [[u64; CODE_BYTES]; KINDS] = [[0; CODE_BYTES]; KINDS];

/// Position of the call of the libm function that is being computed, where its operations are counted; 0
/// outside such functions.
#[unsafe(no_mangle)]
static mut OPERATION_PLACE: u64 = 0;

// The position of a call is its return address.
global_asm!(
    ".macro count kind",
    "mov rax, qword ptr [rip + OPERATION_PLACE]",
    "test rax, rax",
    "cmovz rax, qword ptr [rsp]",
    "sub rax, offset __executable_start",
    "inc qword ptr [rax * 8 + OPERATION_COUNTS + \\kind * {table}]",
    ".endm",
    // Two operands, one result.
    ".macro arithmetic name, kind, instruction",
    ".globl \\name",
    "\\name:",
    "count \\kind",
    "movq xmm0, rdi",
    "movq xmm1, rsi",
    "\\instruction xmm0, xmm1",
    "movq rax, xmm0",
    "ret",
    ".endm",
    "arithmetic __addsf3, 0, addss",
    "arithmetic __subsf3, 0, subss",
    "arithmetic __mulsf3, 1, mulss",
    "arithmetic __divsf3, 2, divss",
    "arithmetic __adddf3, 0, addsd",
    "arithmetic __subdf3, 0, subsd",
    "arithmetic __muldf3, 1, mulsd",
    "arithmetic __divdf3, 2, divsd",
    // A comparison returns a number with the sign of the first operand minus the second. If an operand is
    // NaN, the result is `unordered - 1`.
    ".macro comparison name, instruction, unordered",
    ".globl \\name",
    "\\name:",
    "count 4",
    "movq xmm0, rdi",
    "movq xmm1, rsi",
    "xor ecx, ecx",
    "xor edx, edx",
    "xor eax, eax",
    "\\instruction xmm0, xmm1",
    "seta al",
    "setb cl",
    "setp dl",
    "sub rax, rcx",
    "imul rdx, rdx, \\unordered",
    "add rax, rdx",
    "ret",
    ".endm",
    "comparison __eqsf2, ucomiss, 2",
    "comparison __nesf2, ucomiss, 2",
    "comparison __ltsf2, ucomiss, 2",
    "comparison __lesf2, ucomiss, 2",
    "comparison __gtsf2, ucomiss, 0",
    "comparison __gesf2, ucomiss, 0",
    "comparison __eqdf2, ucomisd, 2",
    "comparison __nedf2, ucomisd, 2",
    "comparison __ltdf2, ucomisd, 2",
    "comparison __ledf2, ucomisd, 2",
    "comparison __gtdf2, ucomisd, 0",
    "comparison __gedf2, ucomisd, 0",
    ".macro unordered name, instruction",
    ".globl \\name",
    "\\name:",
    "count 4",
    "movq xmm0, rdi",
    "movq xmm1, rsi",
    "xor eax, eax",
    "\\instruction xmm0, xmm1",
    "setp al",
    "ret",
    ".endm",
    "unordered __unordsf2, ucomiss",
    "unordered __unorddf2, ucomisd",
    // minNum and maxNum of IEEE 754-2008: if one operand is NaN, the result is the other.
    ".macro extreme name, instruction",
    ".globl \\name",
    "\\name:",
    "count 4",
    "movq xmm0, rdi",
    "movq xmm1, rsi",
    "movaps xmm2, xmm1",
    "\\instruction xmm2, xmm0",
    "ucomiss xmm0, xmm0",
    "cmovp rdi, rsi",
    "movq rax, xmm2",
    "cmovp rax, rsi",
    "ret",
    ".endm",
    "extreme fminf, minss",
    "extreme fmaxf, maxss",
    // Conversion of a number to another type.
    ".macro conversion name, in, out, instruction",
    ".globl \\name",
    "\\name:",
    "count 5",
    "\\in",
    "\\instruction",
    "\\out",
    "ret",
    ".endm",
    "conversion __floatsisf, \"\", \"movq rax, xmm0\", \"cvtsi2ss xmm0, edi\"",
    "conversion __floatunsisf, \"mov edi, edi\", \"movq rax, xmm0\", \"cvtsi2ss xmm0, rdi\"",
    "conversion __floatdisf, \"\", \"movq rax, xmm0\", \"cvtsi2ss xmm0, rdi\"",
    "conversion __floatsidf, \"\", \"movq rax, xmm0\", \"cvtsi2sd xmm0, edi\"",
    "conversion __floatunsidf, \"mov edi, edi\", \"movq rax, xmm0\", \"cvtsi2sd xmm0, rdi\"",
    "conversion __floatdidf, \"\", \"movq rax, xmm0\", \"cvtsi2sd xmm0, rdi\"",
    "conversion __extendsfdf2, \"movq xmm1, rdi\", \"movq rax, xmm0\", \"cvtss2sd xmm0, xmm1\"",
    "conversion __truncdfsf2, \"movq xmm1, rdi\", \"movq rax, xmm0\", \"cvtsd2ss xmm0, xmm1\"",
    "conversion __fixsfsi, \"movq xmm0, rdi\", \"\", \"cvttss2si eax, xmm0\"",
    "conversion __fixunssfsi, \"movq xmm0, rdi\", \"\", \"cvttss2si rax, xmm0\"",
    "conversion __fixsfdi, \"movq xmm0, rdi\", \"\", \"cvttss2si rax, xmm0\"",
    "conversion __fixdfsi, \"movq xmm0, rdi\", \"\", \"cvttsd2si eax, xmm0\"",
    "conversion __fixunsdfsi, \"movq xmm0, rdi\", \"\", \"cvttsd2si rax, xmm0\"",
    "conversion __fixdfdi, \"movq xmm0, rdi\", \"\", \"cvttsd2si rax, xmm0\"",
    // Functions of libm: the call is counted, and all operations in the function are counted at the position
    // of the call.
    ".macro function name",
    ".globl counted_\\name",
    "counted_\\name:",
    "count 7",
    "mov rax, qword ptr [rsp]",
    "mov qword ptr [rip + OPERATION_PLACE], rax",
    "sub rsp, 8",
    "call real_\\name",
    "add rsp, 8",
    "mov qword ptr [rip + OPERATION_PLACE], 0",
    "ret",
    ".endm",
    "function sinf",
    "function cosf",
    "function expf",
    "function powf",
    "function atan2f",
    // Square root, and rounding down (mode 9) and up (mode 10) to an integer.
    ".macro one name, kind, instruction",
    ".globl counted_\\name",
    "counted_\\name:",
    "count \\kind",
    "movq xmm0, rdi",
    "\\instruction",
    "movq rax, xmm0",
    "ret",
    ".endm",
    "one sqrtf, 3, \"sqrtss xmm0, xmm0\"",
    "one floorf, 6, \"roundss xmm0, xmm0, 9\"",
    "one ceilf, 6, \"roundss xmm0, xmm0, 10\"",
    table = const CODE_BYTES * 8,
);

macro_rules! real {
    ($($name:ident = $symbol:ident($($argument:ident),+);)+) => {
        $(
            #[unsafe(no_mangle)]
            extern "C" fn $symbol($($argument: f32),+) -> f32 {
                libm::real::$name($($argument),+)
            }
        )+
    };
}

real! {
    sinf = real_sinf(x);
    cosf = real_cosf(x);
    expf = real_expf(x);
    powf = real_powf(x, y);
    atan2f = real_atan2f(y, x);
}
