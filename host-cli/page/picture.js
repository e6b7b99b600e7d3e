// The picture as far as it has come: four floats a pixel. The last is the mark of an overlay or, without one,
// the negative coarseness. Coarse pixels fill step x step ones.

export class Picture {
    #marks;
    // The greatest marks of the picture that comes, and of all that is shown; negative without any.
    #peak = -1;
    greatest = -1;

    constructor(size = [1, 1]) {
        this.size = size;
        this.data = new Float32Array(4 * size[0] * size[1]);
        this.mark(() => [-1, -1]);
        // Number of the picture, the coarseness of its newest tile, and pixels that have come of that
        // coarseness.
        this.version = 0;
        this.step = Infinity;
        this.samples = 0;
        this.filled = 0;
        // True while the newest tile is of the first pictures of its version; the newest whole picture.
        this.isFirst = true;
        this.whole = { version: 0, step: Infinity };
        // Rows that have changed since `takeDirty`.
        this.dirty = [0, size[1]];
    }

    // All tiles come again, from a version on.
    restart(version) {
        Object.assign(this, { version, step: Infinity, samples: 0, filled: 0, whole: { version: 0, step: Infinity } });
    }

    // A picture of another scene follows.
    clear() {
        this.data.fill(0);
        this.mark(() => [-1, -1]);
        this.restart(0);
    }

    // Another size. The old picture is stretched over the new one until tiles come.
    resize([width, height]) {
        const [oldWidth, oldHeight] = this.size;
        if (width === oldWidth && height === oldHeight) return;
        const old = this.data;
        this.data = new Float32Array(4 * width * height);
        for (let y = 0; y < height; y++) {
            const row = Math.floor(y * oldHeight / height) * oldWidth;
            for (let x = 0; x < width; x++) {
                const from = 4 * (row + Math.floor(x * oldWidth / width));
                const to = 4 * (y * width + x);
                for (let part = 0; part < 4; part++) this.data[to + part] = old[from + part];
            }
        }
        this.size = [width, height];
        this.dirty = [0, height];
        this.filled = 0;
    }

    // Takes a tile. Returns false for one that is older or coarser than what is there, or lies outside.
    put(tile) {
        const [width, height] = this.size;
        if (tile.version < this.version || tile.x >= width || tile.y >= height) return false;
        if (tile.version === this.version && tile.step > this.step) return false;
        this.#begin(tile);
        this.filled += tile.columns * tile.rows;
        const marks = this.#marks(tile);
        for (let row = 0; row < tile.rows; row++) this.#putRow(tile, row, marks);
        this.#peak = Math.max(this.#peak, marks[0]);
        if (this.isWhole) this.whole = { version: this.version, step: this.step };
        // Until a picture is whole, its colours are those of the one before.
        this.greatest = this.isWhole ? this.#peak : Math.max(this.greatest, this.#peak);
        const end = Math.min(height, tile.y + tile.rows * tile.step);
        this.dirty = [Math.min(this.dirty[0], tile.y), Math.max(this.dirty[1], end)];
        return true;
    }

    // Begins another picture, if the tile is of one.
    #begin({ version, step, samples }) {
        if (version === this.version && step === this.step && samples === this.samples) return;
        this.isFirst = version !== this.version;
        Object.assign(this, { version, step, samples, filled: 0 });
        this.#peak = -1;
    }

    #putRow({ x, y, step, columns, pixels }, row, [inner, edge]) {
        const [width, height] = this.size;
        const top = y + row * step;
        if (top >= height) return;
        const right = Math.min(width, x + columns * step);
        const data = this.data;
        let to = 4 * (top * width + x);
        for (let at = x, from = 3 * row * columns, left = step; at < right; at++, to += 4) {
            data[to] = pixels[from];
            data[to + 1] = pixels[from + 1];
            data[to + 2] = pixels[from + 2];
            const mark = row === 0 || at < x + step ? edge : inner;
            data[to + 3] = mark < 0 ? -step : mark;
            if (--left === 0) {
                left = step;
                from += 3;
            }
        }
        const [start, end] = [4 * (top * width + x), 4 * (top * width + right)];
        for (let below = top + 1; below < Math.min(height, top + step); below++) {
            data.copyWithin(start + 4 * width * (below - top), start, end);
        }
    }

    // Marks tiles by a function of a tile: the mark of its pixels, and that of those at its edges. Negative
    // ones are not shown.
    mark(marks) {
        this.#marks = marks;
        this.#peak = this.greatest = -1;
        for (let at = 3; at < this.data.length; at += 4) this.data[at] = -1;
        this.dirty = [0, this.size[1]];
    }

    // True once every pixel of the newest coarseness and number of samples has come.
    get isWhole() {
        const [columns, rows] = this.size.map(side => Math.ceil(side / this.step));
        return this.step < Infinity && this.filled >= columns * rows;
    }

    // Rows `[from, to]` that have changed, null for none; they count as drawn from now on.
    takeDirty() {
        const [from, to] = this.dirty;
        this.dirty = [Infinity, 0];
        return from < to ? [from, to] : null;
    }

    // Values and mark of a pixel; none outside.
    #of([x, y]) {
        const [width, height] = this.size;
        if (!(x >= 0 && y >= 0 && x < width && y < height)) return [];
        const start = 4 * (Math.floor(y) * width + Math.floor(x));
        return [...this.data.subarray(start, start + 4)];
    }

    // Values of a pixel; none outside.
    at(place) {
        return this.#of(place).slice(0, 3);
    }

    // Mark of a pixel; undefined outside.
    markAt(place) {
        return this.#of(place)[3];
    }
}
