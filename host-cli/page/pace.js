// Time of the next drawing: of many wishes to draw, one is granted in a frame.

// Milliseconds between drawings that can wait.
const PAUSE = 100;

export class Pace {
    #frame = 0;
    #timer = 0;
    #last = -Infinity;

    constructor(draw) {
        this.draw = draw;
    }

    // Draws in the next frame.
    soon() {
        clearTimeout(this.#timer);
        this.#timer = 0;
        this.#frame ||= requestAnimationFrame(() => {
            this.#frame = 0;
            this.#last = performance.now();
            this.draw();
        });
    }

    // Draws in a frame that is some time after the last one.
    later() {
        const rest = this.#last + PAUSE - performance.now();
        if (rest <= 0) this.soon();
        else if (!this.isWaiting) this.#timer = setTimeout(() => this.soon(), rest);
    }

    get isWaiting() {
        return this.#frame !== 0 || this.#timer !== 0;
    }
}
