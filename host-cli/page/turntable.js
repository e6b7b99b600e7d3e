// Turns the camera about the centre of its orbit, from frame to frame.

export class Turntable {
    #frame = 0;

    // `turn(radians)` moves the camera, `ended()` lets it rest, `seconds()` is the time of a whole turn.
    constructor(turn, ended, seconds) {
        Object.assign(this, { turn, ended, seconds });
    }

    get isOn() {
        return this.#frame !== 0;
    }

    start() {
        if (!this.isOn) this.#wait(performance.now());
    }

    stop() {
        if (!this.isOn) return;
        cancelAnimationFrame(this.#frame);
        this.#frame = 0;
        this.ended();
    }

    #wait(last) {
        this.#frame = requestAnimationFrame(now => {
            const seconds = Math.min(Math.max(now - last, 0), 100) / 1000;
            this.#wait(now);
            this.turn(2 * Math.PI * seconds / this.seconds());
        });
    }
}
