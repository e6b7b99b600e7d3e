// Errors of a picture against a reference, the time to a stated error, and pictures as PNG. Pictures are `{ width, height, pixels }`, with four
// floats a pixel and rows from the top.

import { deflateSync } from "node:zlib";

const BLOCK = 16;
// Blocks that see the lamp, and share of the mean below which a block is dark; both do not count.
const LAMP = 5, DARK = 0.05;
// Share of the pixels, those of the greatest errors, that relMSE leaves out.
const WORST = 0.001;
// What the noise of the reference brings to all errors, by the standard errors of its pixels.
export const OWN = { relMSE: 2.5e-4, blocks: 1e-6 };

const mean = numbers => numbers.reduce((sum, number) => sum + number, 0) / numbers.length;

function blocks({ width, height }) {
    const found = [];
    for (let y = 0; y < height; y += BLOCK) {
        for (let x = 0; x < width; x += BLOCK) {
            const pixels = [];
            for (let row = y; row < Math.min(y + BLOCK, height); row++) {
                for (let column = x; column < Math.min(x + BLOCK, width); column++) pixels.push(row * width + column);
            }
            found.push(pixels);
        }
    }
    return found;
}

export class Reference {
    #truth;
    #blocks;
    #mean;

    constructor(picture) {
        this.#truth = picture.pixels;
        const isDim = pixels => pixels.every(pixel => [0, 1, 2].every(channel => picture.pixels[4 * pixel + channel] <= LAMP));
        this.#blocks = blocks(picture).filter(isDim);
        this.#mean = mean(this.#blocks.flat().flatMap(pixel => [0, 1, 2].map(channel => picture.pixels[4 * pixel + channel])));
    }

    // - relMSE: mean of squared errors of channels over the reference's square plus 1e-4 of its mean square, without the worst 0.1 % of the pixels;
    // - blocks: mean of squared relative errors of the means of blocks and channels;
    // - median, p95: of their absolute relative errors;
    // - mean: of the picture over the reference's.
    errors({ pixels }) {
        const relative = this.#relativeOfPixels(pixels), ofBlocks = this.#relativeOfBlocks(pixels);
        const sorted = ofBlocks.map(Math.abs).sort((a, b) => a - b);
        const own = mean(this.#blocks.flat().flatMap(pixel => [0, 1, 2].map(channel => pixels[4 * pixel + channel])));
        return {
            relMSE: mean(relative.slice(0, Math.round(relative.length * (1 - WORST)))), blocks: mean(sorted.map(error => error * error)),
            median: sorted[Math.floor(sorted.length / 2)], p95: sorted[Math.floor(0.95 * sorted.length)], mean: own / this.#mean,
        };
    }

    #relativeOfPixels(pixels) {
        const least = 1e-4 * this.#mean ** 2 + 1e-12;
        return this.#blocks.flat().map(pixel => mean([0, 1, 2].map(channel => {
            const truth = this.#truth[4 * pixel + channel];
            return (pixels[4 * pixel + channel] - truth) ** 2 / (truth ** 2 + least);
        }))).sort((a, b) => a - b);
    }

    #relativeOfBlocks(pixels) {
        return this.#blocks.flatMap(block => [0, 1, 2].flatMap(channel => {
            const of = values => mean(block.map(pixel => values[4 * pixel + channel]));
            const truth = of(this.#truth);
            return truth < DARK * this.#mean ? [] : [of(pixels) / truth - 1];
        }));
    }
}

// Samples, seconds and CPU seconds at which a picture of ever more samples reaches a squared error; null if the error is the reference's own. They are
// interpolated between two checkpoints, and extrapolated as one over the number of samples after the last one. `points` have samples, seconds, cpu and errors.
export function reached(points, measure, error) {
    const of = ({ errors }) => errors[measure] - OWN[measure], goal = error - OWN[measure];
    if (goal <= 0) return null;
    const after = points.findIndex(point => of(point) <= goal);
    const [first, last] = [points[0], points.at(-1)];
    if (after === 0) return { ...first, how: "at most" };
    const [low, high] = after < 0 ? [first, last] : points.slice(after - 1, after + 1);
    const samples = after < 0 ? last.samples * of(last) / goal
        : low.samples * (high.samples / low.samples) ** (Math.log(of(low) / goal) / Math.log(of(low) / of(high)));
    const share = (samples - low.samples) / (high.samples - low.samples);
    const at = key => low[key] + share * (high[key] - low[key]);
    return { samples, seconds: at("seconds"), cpu: at("cpu"), how: after < 0 ? "extrapolated" : "" };
}

const CHECKS = Uint32Array.from({ length: 256 }, (_, number) => {
    for (let bit = 0; bit < 8; bit++) number = number & 1 ? 0xedb88320 ^ number >>> 1 : number >>> 1;
    return number >>> 0;
});

function chunk(name, bytes) {
    const body = Buffer.concat([Buffer.from(name, "latin1"), bytes]);
    let check = 0xffffffff;
    for (const byte of body) check = CHECKS[(check ^ byte) & 255] ^ check >>> 8;
    const ends = [Buffer.alloc(4), Buffer.alloc(4)];
    ends[0].writeUInt32BE(bytes.length);
    ends[1].writeUInt32BE((check ^ 0xffffffff) >>> 0);
    return Buffer.concat([ends[0], body, ends[1]]);
}

// Pictures side by side, in sRGB, radiance above 1 as white.
export function png(pictures) {
    const [{ width, height }] = pictures, across = width * pictures.length;
    const rows = Buffer.alloc((1 + 3 * across) * height);
    for (let y = 0, at = 0; y < height; y++) {
        at++;
        for (const { pixels } of pictures) {
            for (let x = 0; x < width; x++) {
                for (let channel = 0; channel < 3; channel++) {
                    const light = Math.min(Math.max(pixels[4 * (y * width + x) + channel], 0), 1);
                    rows[at++] = Math.round(255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055));
                }
            }
        }
    }
    const head = Buffer.alloc(13);
    head.writeUInt32BE(across);
    head.writeUInt32BE(height, 4);
    head.set([8, 2, 0, 0, 0], 8);
    return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}
