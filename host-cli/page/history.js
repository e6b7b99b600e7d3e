// Cameras that a person has rested at, to go back to and forth again.

// Cameras that are kept; the oldest are forgotten.
const KEPT = 200;

export class History {
    #places = [];
    #at = -1;

    // A camera has come to rest. The places that were undone before are forgotten.
    note(camera) {
        if (JSON.stringify(camera) === JSON.stringify(this.#places[this.#at])) return;
        this.#places.splice(this.#at + 1, Infinity, camera);
        if (this.#places.length > KEPT) this.#places.shift();
        this.#at = this.#places.length - 1;
    }

    clear() {
        this.#places = [];
        this.#at = -1;
    }

    get canUndo() {
        return this.#at > 0;
    }

    get canRedo() {
        return this.#at + 1 < this.#places.length;
    }

    // The camera before, or the one that was undone last.
    undone() {
        return this.canUndo ? this.#places[--this.#at] : null;
    }

    redone() {
        return this.canRedo ? this.#places[++this.#at] : null;
    }
}
