// Times as the page sees them, by its own clock: from a change's message to pictures on the screen. Milliseconds.

const KEPT = 200;

export class Times {
    #sent = new Map();
    #lastSent = -Infinity;
    // Instants at which pictures were first whole, coarse or not, and the version of the last one.
    #wholes = [];
    #counted = 0;
    // Measurements, newest last: {what, version, first, coarse, full, settled}.
    measured = [];

    // A message that makes a new picture was sent.
    sent(id, what) {
        if (id === 0) return;
        this.#lastSent = performance.now();
        this.#sent.set(id, { what, at: this.#lastSent });
        if (this.#sent.size > KEPT) this.#sent.delete(this.#sent.keys().next().value);
    }

    // The first picture of this page, measured since the page was asked for.
    opened(version) {
        this.#begin({ what: "opening", at: 0 }, version);
    }

    // `state` names the version that holds the message `id`, and with it all that were sent before.
    known(id, version) {
        const held = [...this.#sent].filter(([sent]) => sent <= id);
        if (held.length === 0) return;
        const [, found] = held.at(-1);
        for (const [sent] of held) this.#sent.delete(sent);
        this.#begin(found, version);
    }

    #begin({ what, at }, version) {
        this.measured.push({ what, at, version });
        if (this.measured.length > KEPT) this.measured.shift();
    }

    // The picture was drawn. It answers all changes that it holds, even if it is newer.
    drawn({ version, whole }) {
        const now = performance.now();
        if (whole.version > this.#counted) {
            this.#counted = whole.version;
            this.#wholes.push(now);
        }
        while (this.#wholes[0] < now - 1000) this.#wholes.shift();
        for (const run of this.measured.filter(run => run.version <= version)) run.first ??= now - run.at;
        for (const run of this.measured.filter(run => run.version <= whole.version)) {
            run.coarse ??= now - run.at;
            if (whole.step === 1) run.full ??= now - run.at;
        }
    }

    settled(version) {
        const now = performance.now();
        for (const run of this.measured.filter(run => run.version <= version)) run.settled ??= now - run.at;
    }

    // Messages that no picture holds yet, and time since the last one.
    get waiting() {
        return this.#sent.size;
    }

    get silence() {
        return performance.now() - this.#lastSent;
    }

    // Whole pictures in the last second.
    get rate() {
        return this.#wholes.filter(at => at > performance.now() - 1000).length;
    }

    get text() {
        const run = this.measured.at(-1);
        if (!run) return "";
        const parts = ["first", "coarse", "full", "settled"].filter(part => run[part] !== undefined);
        const told = parts.map(part => `${part} ${Math.round(run[part])} ms`);
        return [run.what, ...told, `${this.rate} pictures/s`].join(" · ");
    }
}
