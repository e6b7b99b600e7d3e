// Tiles as they come from the command: a head of eleven little-endian words, and pixels of three floats.

const HEAD = 44;
// Count that is not known.
const UNKNOWN = 0xffffffff;

// The tile of a message; null if its length is not what its head says.
export function decoded(buffer) {
    if (buffer.byteLength < HEAD) return null;
    const words = new DataView(buffer);
    const [version, step, x, y, columns, rows, samples, card, gathers, records, dram] =
        Array.from({ length: HEAD / 4 }, (_, index) => words.getUint32(4 * index, true));
    if (step === 0 || buffer.byteLength !== HEAD + 12 * columns * rows) return null;
    const lines = dram === UNKNOWN ? NaN : dram;
    return { version, step, x, y, columns, rows, samples, card, gathers, records, lines, pixels: floats(buffer) };
}

const IS_LITTLE = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;

function floats(buffer) {
    if (IS_LITTLE) return new Float32Array(buffer, HEAD);
    const words = new DataView(buffer, HEAD);
    return Float32Array.from({ length: words.byteLength / 4 }, (_, index) => words.getFloat32(4 * index, true));
}
