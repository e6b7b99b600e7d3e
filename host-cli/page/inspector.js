// Values of a pixel, and how bright the picture is: a histogram in stops about middle grey, and what is
// clipped.

import { setText } from "./status.js";
import { MODES, codes, luminance } from "./tone.js";

const byId = id => document.getElementById(id);
// Stops that the histogram shows, bars in it, pixels that are looked at, and milliseconds between two of
// them.
const [LOW, HIGH] = [-10, 6];
const BARS = 64;
const PIXELS = 40000;
const PAUSE = 250;
const COLOURS = ["#ff6060", "#60d060", "#7090ff"];

// Shares of pixels in each bar, by channel, and of those that are shown black or clipped.
export function histogram(data, tone, stride = 1) {
    const bars = [0, 1, 2].map(() => new Float32Array(BARS));
    let count = 0, black = 0, clipped = 0;
    for (let at = 0; at < data.length; at += 4 * stride) {
        const rgb = [data[at], data[at + 1], data[at + 2]];
        rgb.forEach((value, channel) => {
            const stops = Math.log2(value * tone.scale / 0.18);
            const bar = Math.floor((stops - LOW) / (HIGH - LOW) * BARS);
            if (value > 0) bars[channel][Math.min(Math.max(bar, 0), BARS - 1)]++;
        });
        const shown = codes(rgb, tone);
        black += shown.every(code => code === 0);
        clipped += shown.some(code => code === 255);
        count++;
    }
    return { bars: bars.map(bar => bar.map(value => value / count)), black: black / count, clipped: clipped / count };
}

export class Inspector {
    #drawnAt = -Infinity;

    // Shows the pixel at a place, or none, and now and then the histogram.
    show(at, picture, tone) {
        const value = at ? picture.at(at) : [];
        const text = value.length ? `${at.join(", ")}: ${value.map(part => part.toPrecision(4)).join("  ")}` : "\u00a0";
        setText("value", text);
        if (!byId("inspector").open) return;
        this.#showPixel(value, tone);
        const now = performance.now();
        if (now < this.#drawnAt + PAUSE) return;
        this.#drawnAt = now;
        this.#showHistogram(picture, tone);
    }

    // The histogram is drawn anew with the next picture.
    renew() {
        this.#drawnAt = -Infinity;
    }

    #showPixel(value, tone) {
        const shown = value.length ? codes(value, tone) : [];
        const hex = `#${shown.map(code => code.toString(16).padStart(2, "0")).join("")}`;
        byId("swatch").style.background = shown.length ? hex : "none";
        const isLight = tone.mode === MODES.light && shown.length > 0;
        const light = isLight ? luminance(...value) : 0;
        const stops = Math.log2(light * tone.scale / 0.18);
        const told = light > 0 ? `, luminance ${light.toPrecision(3)}, ${stops >= 0 ? "+" : ""}${stops.toFixed(1)} stops` : "";
        setText("shown", shown.length ? `${hex}${told}` : "Point at the picture.");
    }

    #showHistogram(picture, tone) {
        const canvas = byId("histogram");
        canvas.parentElement.hidden = tone.mode !== MODES.light;
        if (canvas.parentElement.hidden) return;
        const stride = Math.ceil(picture.data.length / 4 / PIXELS);
        const { bars, black, clipped } = histogram(picture.data, tone, stride);
        const { width, height } = canvas;
        const context = canvas.getContext("2d");
        const most = Math.max(...bars.map(bar => Math.max(...bar)), 1e-6);
        const across = stops => (stops - LOW) / (HIGH - LOW) * width;
        context.globalCompositeOperation = "source-over";
        context.fillStyle = "#101010";
        context.fillRect(0, 0, width, height);
        context.fillStyle = "#4a4a4a";
        for (let stops = LOW; stops <= HIGH; stops += 2) context.fillRect(across(stops), 0, stops === 0 ? 2 : 1, height);
        context.globalCompositeOperation = "lighter";
        bars.forEach((bar, channel) => {
            context.fillStyle = COLOURS[channel];
            bar.forEach((share, at) => {
                const tall = height * Math.sqrt(share / most);
                context.fillRect(at * width / BARS, height - tall, width / BARS, tall);
            });
        });
        const percent = share => `${(100 * share).toFixed(share < 0.0995 ? 1 : 0)} %`;
        setText("clipping", `${percent(clipped)} clipped, ${percent(black)} black; middle grey at the thick line, 2 stops a line`);
    }
}
