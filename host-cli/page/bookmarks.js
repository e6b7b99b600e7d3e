// Cameras that a person names, kept by the browser for each scene.

import { element } from "./fields.js";

const byId = id => document.getElementById(id);
// Bookmarks of a scene; the first ones have the keys 1 to 9.
const MOST = 40;

export class Bookmarks {
    #key = "";
    #list = [];

    // `camera()` is the present camera, or null; `go(camera)` moves there.
    constructor(camera, go) {
        this.go = go;
        byId("bookmark").addEventListener("click", () => {
            const here = camera();
            if (here && this.#list.length < MOST) this.#change([...this.#list, { name: this.#free(), camera: here }]);
        });
    }

    // Shows the bookmarks of a scene.
    open(scene) {
        this.#key = `photoncard cameras of ${scene}`;
        this.#list = read(this.#key);
        this.#show();
    }

    // Goes to a bookmark, if there is one of this number.
    visit(index) {
        if (this.#list[index]) this.go(this.#list[index].camera);
    }

    #free() {
        const names = this.#list.map(({ name }) => name);
        let number = 1;
        while (names.includes(`View ${number}`)) number++;
        return `View ${number}`;
    }

    #change(list) {
        this.#list = list;
        write(this.#key, list);
        this.#show();
    }

    #show() {
        byId("bookmarks").replaceChildren(...this.#list.map(({ name, camera }, index) => {
            const key = index < 9 ? ` (${index + 1})` : "";
            const go = element("button", { type: "button", textContent: `Go${key}`, ariaLabel: `Go${key} to ${name}` });
            const label = element("input", { value: name, ariaLabel: "Name of the bookmark", spellcheck: false });
            const remove = element("button", { type: "button", textContent: "×", ariaLabel: `Remove ${name}` });
            go.addEventListener("click", () => this.go(camera));
            label.addEventListener("change", () =>
                this.#change(this.#list.map((kept, at) => at === index ? { ...kept, name: label.value } : kept)));
            remove.addEventListener("click", () => this.#change(this.#list.filter((_, at) => at !== index)));
            return element("li", { className: "row" }, go, label, remove);
        }));
    }
}

const isPoint = point => Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);

// A browser may keep nothing, or something else under this name.
function read(key) {
    try {
        return JSON.parse(localStorage.getItem(key)).slice(0, MOST).filter(({ name, camera }) =>
            typeof name === "string" && isPoint(camera.position) && isPoint(camera.look_at));
    } catch {
        return [];
    }
}

function write(key, list) {
    try {
        localStorage.setItem(key, JSON.stringify(list));
    } catch {
        // The bookmarks last as long as the page.
    }
}
