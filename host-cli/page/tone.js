// Radiance to codes of a screen: the exposure and curves of `photoncard tonemap`, once for the processor and once as a shader.

const WHITE = 4;
const MAX = 1e18;
const MIDDLE_GREY = 0.18;

// Meaning of a picture's values, by layer: light is exposed and compressed, the others have a fixed scale.
export const MODES = { light: 0, share: 1, direction: 2, amount: 3 };

export const modeOf = layer =>
    ["radiance", "direct", "indirect", "caustic"].includes(layer) ? MODES.light
        : ["albedo", "alpha"].includes(layer) ? MODES.share
            : layer === "N" ? MODES.direction : MODES.amount;

export const CURVES = ["none", "reinhard", "aces"];

// Marks over the picture: none, the colour of the card, or a map of heat.
export const OVERLAYS = { none: 0, card: 1, heat: 2 };

export const luminance = (red, green, blue) => Math.fround(0.2126 * red + 0.7152 * green + 0.0722 * blue);

// Scale that brings the log-average luminance of the lit pixels to middle grey. `stride` skips pixels: 1 takes all.
export function automaticScale(data, stride = 1) {
    let sum = 0, count = 0;
    for (let at = 0; at < data.length; at += 4 * stride) {
        const light = luminance(data[at], data[at + 1], data[at + 2]);
        if (light > 0 && light < Infinity) {
            sum += Math.log(light);
            count++;
        }
    }
    return count === 0 ? 1 : MIDDLE_GREY / Math.exp(sum / count);
}

// The greatest finite value of a layer of amounts.
export function greatest(data, stride = 1) {
    let found = 0;
    for (let at = 0; at < data.length; at += 4 * stride) {
        if (data[at] > found && data[at] < Infinity) found = data[at];
    }
    return found;
}

function compressed(curve, rgb) {
    if (curve === "aces") return rgb.map(x => x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
    if (curve === "none") return rgb;
    const light = luminance(...rgb);
    return rgb.map(x => x * (1 + light / (WHITE * WHITE)) / (1 + light));
}

const encoded = x => x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
const unit = x => Math.min(Math.max(x, 0), 1);

// Colour of an amount from 0 to 1: black, blue, red, white.
const heat = t => [unit(3 * t - 1), unit(3 * t - 2), unit(t < 1 / 3 ? 3 * t : t < 2 / 3 ? 2 - 3 * t : 3 * t - 2)];

// Colour of a card, which tells eight neighbours apart.
export const cardColour = card =>
    [0, 1 / 3, 2 / 3].map(shift => 0.5 + 0.5 * Math.cos(2 * Math.PI * (card * 0.381966 + shift)));

// Codes 0 to 255 of a pixel `[r, g, b]`, as the shader below computes them.
export function codes(rgb, { mode, scale, curve }) {
    const scaled = rgb.map(x => x * scale);
    if (scaled.some(Number.isNaN)) return [0, 0, 0];
    const shown = mode === MODES.direction ? rgb.map(x => unit(0.5 + 0.5 * x))
        : mode === MODES.amount ? heat(unit(scaled[0]))
            : (mode === MODES.share ? rgb : compressed(curve, scaled.map(x => Math.min(Math.max(x, 0), MAX))))
                .map(x => encoded(unit(x)));
    return shown.map(x => Math.floor(255 * x + 0.5));
}

// Codes of a pixel with its mark, as the shader below computes them. Marks of cards are a half higher along the edges of tiles.
export function marked(codes, mark, { overlay, greatest }) {
    if (overlay === OVERLAYS.none || mark < 0) return codes;
    const mixed = (from, to, share) => codes.map((_, part) => Math.floor(from(part) * (1 - share) + 255 * to[part] * share + 0.5));
    if (overlay === OVERLAYS.card) return mixed(part => codes[part], cardColour(Math.floor(mark)), mark % 1 > 0.25 ? 0.8 : 0.35);
    return mixed(() => luminance(...codes), heat(unit(mark / greatest)), 0.65);
}

export const SHADER = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D picture;
uniform float scale, greatest;
uniform int mode, curve, overlay;
uniform bool isPreview;
out vec4 colour;

vec3 compressed(vec3 x) {
    if (curve == 2) return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    if (curve == 0) return x;
    float light = dot(x, vec3(0.2126, 0.7152, 0.0722));
    return x * ((1.0 + light / ${WHITE * WHITE}.0) / (1.0 + light));
}

vec3 encoded(vec3 x) {
    return mix(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}

vec3 heat(float t) {
    float blue = t < 1.0 / 3.0 ? 3.0 * t : t < 2.0 / 3.0 ? 2.0 - 3.0 * t : 3.0 * t - 2.0;
    return clamp(vec3(3.0 * t - 1.0, 3.0 * t - 2.0, blue), 0.0, 1.0);
}

vec3 shown(vec3 value) {
    if (any(isnan(value))) return vec3(0.0);
    if (mode == 2) return clamp(0.5 + 0.5 * value, 0.0, 1.0);
    if (mode == 3) return heat(clamp(value.r * scale, 0.0, 1.0));
    if (mode == 0) value = compressed(clamp(value * scale, 0.0, ${MAX.toExponential(1)}));
    return encoded(clamp(value, 0.0, 1.0));
}

vec3 marked(vec3 shown, float mark) {
    if (overlay == 0 || mark < 0.0) return shown;
    vec3 card = 0.5 + 0.5 * cos(6.2831853 * (floor(mark) * 0.381966 + vec3(0.0, 1.0, 2.0) / 3.0));
    if (overlay == 1) return mix(shown, card, fract(mark) > 0.25 ? 0.8 : 0.35);
    return mix(vec3(dot(shown, vec3(0.2126, 0.7152, 0.0722))), heat(clamp(mark / greatest, 0.0, 1.0)), 0.65);
}

const vec3 LIGHT = vec3(0.2126, 0.7152, 0.0722);

// What a square of the preview shows.
vec3 square(ivec2 at, int side) {
    return shown(texelFetch(picture, clamp(at * side + side / 2, ivec2(0), textureSize(picture, 0) - 1), 0).rgb);
}

// A square of the preview as bright as the least and the most of its neighbours let it be: others are stray paths.
vec3 calm(ivec2 at, int side) {
    vec3 own = square(at, side);
    vec2 range = vec2(1.0, 0.0);
    for (int y = -1; y <= 1; y++) for (int x = -1; x <= 1; x++) {
        float light = dot(square(at + ivec2(x, y), side), LIGHT);
        if (x != 0 || y != 0) range = vec2(min(range.x, light), max(range.y, light));
    }
    float light = dot(own, LIGHT);
    return own + clamp(light, range.x, range.y) - light;
}

// The squares of a preview, smoothed where neighbours look alike. Edges stay.
vec3 smoothed(vec2 place, int side) {
    vec2 at = place / float(side) - 0.5;
    ivec2 nearest = ivec2(floor(at + 0.5));
    vec3 own = calm(nearest, side);
    vec4 sum = vec4(0.0);
    for (int y = -2; y <= 2; y++) for (int x = -2; x <= 2; x++) {
        vec3 value = square(nearest + ivec2(x, y), side);
        vec2 way = vec2(nearest + ivec2(x, y)) - at;
        vec3 change = value - own;
        float light = dot(change, LIGHT);
        sum += vec4(value, 1.0) * exp(-dot(way, way) / 2.0 - light * light / 0.04 - dot(change, change) / 0.3);
    }
    return sum.a > 0.0 ? sum.rgb / sum.a : own;
}

void main() {
    ivec2 size = textureSize(picture, 0);
    vec2 place = vec2(gl_FragCoord.x, float(size.y) - gl_FragCoord.y);
    vec4 texel = texelFetch(picture, ivec2(place), 0);
    int side = isPreview && texel.a < 0.0 ? int(-texel.a) : 0;
    vec3 seen = side == 0 ? shown(texel.rgb) : side == 1 ? calm(ivec2(place), 1) : smoothed(place, side);
    colour = vec4(marked(seen, texel.a), 1.0);
}`;
