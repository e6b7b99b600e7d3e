// Place of the picture on the stage: fitted, or magnified and shifted. The picture itself stays as it is.

const GREATEST = 32;
const clamped = (value, low, high) => Math.min(Math.max(value, low), high);

// Puts an element at a place [left, top, width, height] on the stage.
export const putAt = ({ style }, place) =>
    ["left", "top", "width", "height"].forEach((side, at) => style[side] = `${place[at]}px`);

export class Zoom {
    // Factor beyond the fitting size, and the point of the picture in the middle of the stage, as shares of
    // its sides.
    factor = 1;
    #centre = [0.5, 0.5];

    get isFitted() {
        return this.factor === 1;
    }

    fit() {
        this.factor = 1;
        this.#centre = [0.5, 0.5];
    }

    // Rectangle [left, top, width, height] of a picture that has the size `fitting` unless it is magnified.
    place(stage, fitting) {
        const size = fitting.map(side => side * this.factor);
        const corner = size.map((side, axis) => {
            // Of a picture larger than the stage no edge comes inside; a smaller one is in the middle.
            const free = stage[axis] - side;
            return free >= 0 ? free / 2 : clamped(stage[axis] / 2 - this.#centre[axis] * side, free, 0);
        });
        this.#centre = size.map((side, axis) => (stage[axis] / 2 - corner[axis]) / side);
        return [...corner, ...size];
    }

    // Magnifies about a point of the stage, which stays.
    by(factor, at, stage, fitting) {
        const [left, top, width, height] = this.place(stage, fitting);
        const held = [(at[0] - left) / width, (at[1] - top) / height];
        this.factor = clamped(this.factor * factor, 1, GREATEST);
        this.#centre = held.map((share, axis) => share + (stage[axis] / 2 - at[axis]) / (fitting[axis] * this.factor));
    }

    // Shifts the picture by pixels of the stage.
    shift(by, fitting) {
        this.#centre = this.#centre.map((share, axis) => share - by[axis] / (fitting[axis] * this.factor));
    }
}
