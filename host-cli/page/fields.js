// Fields of the panel: inputs of named values. A field shows what the command has, except while it is being used.

// Element with properties and children.
export function element(name, properties = {}, ...children) {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
}

const linear = code => code <= 0.04045 ? code / 12.92 : ((code + 0.055) / 1.055) ** 2.4;
const encoded = x => x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
const byte = x => Math.round(255 * encoded(Math.min(Math.max(x, 0), 1))).toString(16).padStart(2, "0");

// Linear colours, which may be one number, as text of an `<input type=color>`, and back.
export const hexOf = value => `#${rgb(value).map(byte).join("")}`;
export const linearOf = hex => [1, 3, 5].map(at => linear(parseInt(hex.slice(at, at + 2), 16) / 255));

const rgb = value => Array.isArray(value) ? value : [value, value, value];

// Numbers as people write them.
export const short = value => String(Number(Number(value).toPrecision(5)));

// Milliseconds for which a field that was used does not show what the command has: it may not have the change yet.
const USED = 1000;

export class Fields {
    // Values of the file, and functions that show a value, by name.
    #own = new Map();
    #shows = new Map();
    #values = new Map();

    // `edit(name, value)` asks the command for another value.
    constructor(edit) {
        this.edit = edit;
    }

    // Shows values by name; those without one are the file's. After a refused change a field that is being used shows its own too.
    show(values, isRefused = false) {
        for (const [name, own] of this.#own) {
            this.#values.set(name, values.get(name) ?? own);
            for (const show of this.#shows.get(name)) show(isRefused);
        }
    }

    // Makes `control` show the value of a name by `show(value)`.
    follow(name, own, control, show) {
        let used = -Infinity;
        const isUsed = () => control.contains(document.activeElement) &&
            (document.activeElement.type === "number" || performance.now() < used + USED);
        const current = () => this.#values.get(name);
        control.addEventListener("input", () => used = performance.now());
        control.addEventListener("focusout", () => current() !== null && show(current()));
        this.#own.set(name, own);
        this.#values.set(name, own);
        this.#shows.set(name, [...this.#shows.get(name) ?? [], isRefused => {
            if (current() !== null && (isRefused || !isUsed())) show(current());
        }]);
        if (own !== null) show(own);
        return control;
    }

    // A number; a slider if it has a maximum.
    number(name, label, own, maximum) {
        const input = maximum === undefined
            ? element("input", { type: "number", min: 0, step: "any" })
            : element("input", { type: "range", min: 0, max: maximum, step: 0.01 });
        const told = element("output");
        const control = element("label", {}, label, maximum === undefined ? input : element("span", {}, input, told));
        input.addEventListener("input", () => {
            if (!isNumber(input)) return;
            told.textContent = input.value;
            this.edit(name, Number(input.value));
        });
        return this.follow(name, own, control, value => told.textContent = input.value = short(value));
    }

    colour(name, label, own) {
        const input = element("input", { type: "color" });
        input.addEventListener("input", () => this.edit(name, linearOf(input.value)));
        const control = element("label", {}, label, input);
        return this.follow(name, own, control, value => input.value = hexOf(value));
    }

    emission(name, own) {
        const number = element("input", { type: "number", min: 0, step: "any" });
        return this.#tinted(name, own, ["Emission", "Strength, W/(sr m²)"], number);
    }

    // Factors of the light of a group.
    gain(name, own) {
        const number = element("input", { type: "range", min: 0, max: 4, step: 0.01 });
        return this.#tinted(name, own, ["Colour", "Factor"], number);
    }

    // A colour beyond 1, as colour and strength.
    #tinted(name, own, [ofTint, ofNumber], number) {
        let colour = [1, 1, 1], strength = 0;
        const tint = element("input", { type: "color" });
        const told = element("output");
        const edit = () => {
            if (!isNumber(number)) return;
            told.textContent = short(number.value);
            this.edit(name, colour.map(part => part * Number(number.value)));
        };
        tint.addEventListener("input", () => {
            colour = linearOf(tint.value);
            edit();
        });
        number.addEventListener("input", edit);
        const control = element("div", {},
            element("label", {}, ofTint, tint),
            element("label", {}, ofNumber, number.type === "range" ? element("span", {}, number, told) : number));
        return this.follow(name, own, control, value => {
            strength = Math.max(...rgb(value));
            if (strength > 0) colour = rgb(value).map(part => part / strength);
            [tint.value, number.value] = [hexOf(colour), short(strength)];
            told.textContent = short(strength);
        });
    }

    // A tick that takes a value to 0 and back, or to another one.
    onOff(name, own, label = "on", lit = own) {
        const input = element("input", { type: "checkbox" });
        const dark = Array.isArray(own) ? [0, 0, 0] : 0;
        input.addEventListener("change", () => this.edit(name, input.checked ? lit : dark));
        return this.follow(name, own, element("label", { className: "tick" }, input, label), value => {
            input.checked = rgb(value).some(part => part > 0);
            if (input.checked) lit = value;
        });
    }

    place(name, own) {
        const inputs = ["x", "y", "z"].map(axis => element("input", { type: "number", step: "any", ariaLabel: axis }));
        const control = element("fieldset", { className: "place" }, element("legend", { textContent: "Position, m" }), ...inputs);
        control.addEventListener("input", () => {
            if (inputs.every(isNumber)) this.edit(name, inputs.map(input => Number(input.value)));
        });
        return this.follow(name, own, control,
            value => inputs.forEach((input, axis) => input.value = short(value[axis])));
    }

    // One of several values, or a whole number of at least `choices`.
    choice(name, label, choices) {
        const isList = Array.isArray(choices);
        const input = element(isList ? "select" : "input", isList ? {} : { type: "number", min: choices, step: 1 });
        if (isList) input.append(...choices.map(([value, text]) => element("option", { value, textContent: text })));
        input.addEventListener("change", () => {
            if (isList) this.edit(name, choices[input.selectedIndex][0]);
            else if (isNumber(input)) this.edit(name, Number(input.value));
        });
        return this.follow(name, null, element("label", {}, label, input), value => input.value = value);
    }
}

const isNumber = input => input.validity.valid && input.value !== "";
