// The panel's lists of lights, materials, techniques, costs and cards, made from what the command says of them.

import { Fields, element, hexOf, short } from "./fields.js";
import { cardColour } from "./tone.js";

// Properties with a slider, which end at 1, and names of others.
const SHARES = ["roughness", "metallic", "transmission", "alpha"];
const LABELS = { ior: "index of refraction" };
const labelOf = property => (LABELS[property] ?? property).replace(/^./, first => first.toUpperCase());

const listed = names => names.map(name => [name, name]);

// Techniques: name in `setting`, label, and choices, or the least number.
const TECHNIQUES = [
    ["photons", "Photons", 1],
    ["spp", "Samples a pixel", 1],
    ["gather_rays", "Gather rays", 0],
    ["tile", "Side of tiles (0: widest)", 0],
    ["order", "Order of gathers", listed(["naive", "tiled", "dirbin", "hash", "sort"])],
    ["sampling", "Importance sampling", listed(["brdf", "photon", "combined", "mixture", "focused"])],
    ["cache", "Irradiance cache", [[true, "on"], [false, "off"]]],
];

export function bytes(count) {
    const step = Math.min(Math.floor(Math.log10(Math.max(count, 1)) / 3), 3);
    return `${rounded(count / 1000 ** step)} ${["B", "kB", "MB", "GB"][step]}`;
}

const rounded = value => short(Number(value.toPrecision(3)));
const seconds = value => value < 0.0995 ? `${rounded(1000 * value)} ms` : `${rounded(value)} s`;
const faint = text => element("p", { className: "small", textContent: text });

export class Panel {
    // Cost of a settled picture by setting (`order=sort`), and settings and cost of the last one.
    #costs = new Map();
    #last = null;
    #told = new Map();
    #shown = "";

    // `edit(name, value)` changes the scene, `set(name, value)` a technique, `mix(name, value)` the light of a group.
    constructor(edit, set, mix) {
        this.edits = edit;
        this.mixes = mix;
        this.techniques = new Fields(set);
        this.#fill("techniques", TECHNIQUES.map(([name, label, choices]) => {
            const told = faint("");
            this.#told.set(name, told);
            return element("div", {}, this.techniques.choice(name, label, choices), told);
        }));
    }

    // The scene of a new connection; the same one stays as it is.
    show(scene) {
        const text = JSON.stringify(scene);
        if (text === this.#shown) return;
        this.#shown = text;
        const { lights, materials, environment } = scene;
        const fields = this.scene = new Fields(this.edits);
        const ofName = [...new Map([...materials].reverse().map(material => [material.name, material])).values()].reverse();
        const isLamp = ({ properties }) => [properties.emission ?? 0].flat().some(value => value > 0);
        this.#fill("lights", [
            ...lights.map(light => this.#light(fields, light)),
            ...ofName.filter(isLamp).map(({ name, properties: { emission } }) => element("fieldset", {},
                element("legend", { textContent: name }),
                fields.onOff(`${name}.emission`, emission), fields.emission(`${name}.emission`, emission))),
            ...environment ? [fields.number("environment.strength", "Environment", environment.strength)] : [],
        ], "The scene has no light that can be changed.");
        this.#fill("materials", ofName.map(material => this.#material(fields, material)), "The scene has none.");
    }

    // The light groups of a new connection.
    showGroups(names) {
        this.groups = new Fields(this.mixes);
        document.getElementById("mix").hidden = names.length === 0;
        this.#fill("mix", names.map(name => element("fieldset", {},
            element("legend", { textContent: name }), this.groups.gain(name, 1))));
    }

    #fill(id, children, otherwise = "") {
        const section = document.getElementById(id);
        section.replaceChildren(section.querySelector("h2"), ...children.length > 0 ? children : [faint(otherwise)]);
    }

    #light(fields, { name, kind, colour, strength, unit, position }) {
        return element("fieldset", {}, element("legend", { textContent: `${name}, ${kind}` }),
            fields.onOff(`${name}.intensity`, strength),
            fields.colour(`${name}.colour`, "Colour", colour),
            fields.number(`${name}.intensity`, `Strength${unit ? `, ${unit}` : ""}`, strength),
            ...position ? [fields.place(`${name}.position`, position)] : []);
    }

    #material(fields, { name, properties }) {
        const swatch = element("span", { className: "swatch" });
        fields.follow(`${name}.diffuse`, properties.diffuse ?? 0, swatch, value => swatch.style.background = hexOf(value));
        const rows = Object.entries(properties).map(([property, value]) => {
            const of = `${name}.${property}`;
            if (property === "emission") return fields.emission(of, value);
            if (property === "thickness") return this.#solid(fields, of, value, `${name}.transmission`, properties.transmission);
            if (Array.isArray(value)) return fields.colour(of, labelOf(property), value);
            return fields.number(of, labelOf(property), value, SHARES.includes(property) ? 1 : undefined);
        });
        return element("details", {}, element("summary", {}, swatch, name), ...rows);
    }

    // A tick for solids, of what transmits light alone.
    #solid(fields, name, value, transmission, own) {
        const control = fields.onOff(name, value, "Solid, not a thin wall", 1);
        return fields.follow(transmission, own, control, share => control.hidden = !(share > 0));
    }

    // The state of the picture; the last change may have been refused.
    update({ changes = [], settings = {}, gains = {}, cost, settled }, isRefused = false) {
        this.groups?.show(new Map(Object.entries(gains)), isRefused);
        this.scene?.show(new Map(changes.map(({ name, value }) => [name, value])), isRefused);
        this.techniques.show(new Map(Object.entries(settings)), isRefused);
        if (cost) this.#showCost(cost);
        if (cost && settled) this.#remember(settings, cost);
    }

    // Notes what a settled picture took at the settings that differ from those of the picture before, and what that took.
    #remember(settings, cost) {
        const whole = Object.values(cost.seconds).reduce((sum, value) => sum + value, 0);
        const text = `${seconds(whole)}, ${bytes(cost.sent)} sent`;
        for (const [name] of TECHNIQUES) {
            if (this.#last && this.#last.settings[name] !== settings[name]) {
                this.#costs.set(`${name}=${this.#last.settings[name]}`, this.#last.text);
                this.#costs.set(`${name}=${settings[name]}`, text);
            }
            const costs = [...this.#costs].filter(([key]) => key.startsWith(`${name}=`));
            this.#told.get(name).textContent = costs.map(([key, told]) => `${key.slice(name.length + 1)}: ${told}`).join("; ");
        }
        this.#last = { settings: { ...settings }, text };
    }

    #showCost({ seconds: phases, bytes: held, sent }) {
        const row = (label, text) =>
            element("tr", {}, element("td", { textContent: label }), element("td", { textContent: text }));
        document.getElementById("cost").replaceChildren(
            ...Object.entries(phases).map(([phase, value]) => row(phase, seconds(value))),
            ...Object.entries(held).map(([part, count]) => row(`memory, ${part}`, bytes(count))),
            row("sent to cards", bytes(sent)));
    }

    // Adds a line that a host in this page has printed, such as what it ignores of a scene.
    notice(line) {
        const notices = document.getElementById("notices"), list = notices.querySelector("ul");
        list.append(element("li", { textContent: line.replace(/^photoncard: /, "") }));
        notices.querySelector("summary").textContent = `${list.children.length} ${list.children.length === 1 ? "notice" : "notices"} about this scene`;
        notices.hidden = false;
    }

    forgetNotices() {
        const notices = document.getElementById("notices");
        notices.querySelector("ul").replaceChildren();
        notices.hidden = true;
    }

    cards(cards) {
        document.getElementById("cards").replaceChildren(...cards.map(({ name, state, tiles, error }, index) => {
            // Tiles keep the number of their card, so that one that has gone keeps its place.
            if (state === "gone") return "";
            const swatch = element("span", { className: "swatch" });
            swatch.style.background = `rgb(${cardColour(index).map(part => Math.round(255 * part)).join()})`;
            const told = element("span", { className: state, textContent: ` ${state}` });
            const more = element("small", { textContent: `${tiles} tiles${error ? `, ${error}` : ""}` });
            return element("li", {}, swatch, name, told, element("br"), more);
        }));
    }
}
