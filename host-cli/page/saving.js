// Pictures that a person saves: into the command's folder, or as a download of the browser.

import { setText } from "./status.js";

const byId = id => document.getElementById(id);

export class Saving {
    #folder = null;

    // `save(fields)` asks the command for a picture.
    constructor(save) {
        for (const ending of ["exr", "png"]) {
            byId(`save-${ending}`).addEventListener("click", () => {
                const name = `${byId("name").value.trim().replace(/\.(exr|png)$/i, "")}.${ending}`;
                setText("saved", `Encoding ${name}.`);
                save({ name, download: this.#folder === null || byId("download").checked });
            });
        }
    }

    // The folder of the command, or null if it has none: pictures are downloads then.
    open(folder) {
        this.#folder = folder;
        byId("download").parentElement.hidden = folder === null;
        setText("saved", folder === null ? "" : `to ${folder}`);
    }

    saved(path) {
        setText("saved", `saved ${path}`);
    }

    refused() {
        setText("saved", "");
    }

    // Offers a file that has come.
    offer({ name, bytes }) {
        const kind = name.endsWith(".png") ? "image/png" : "image/x-exr";
        const href = URL.createObjectURL(new Blob([bytes], { type: kind }));
        const link = Object.assign(document.createElement("a"), { href, download: name });
        link.click();
        // The browser has begun to read it by then.
        setTimeout(() => URL.revokeObjectURL(href), 10000);
        setText("saved", `downloaded ${name}`);
    }
}
