// The picture on a canvas: by WebGL2, where exposure and curve cost nothing, or else by the processor on a 2D
// canvas.

import { CURVES, SHADER, codes, marked } from "./tone.js";

const CORNERS = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1, 0, 1); }`;

// A display has `draw(picture, tone)`; `tone` is {mode, scale, curve, overlay, greatest, isPreview}. Of a
// preview the shader smooths the squares, the processor does not. `restored()` is called when a lost context
// is there again.
export function displayOn(canvas, restored) {
    const options = { alpha: false, antialias: false, depth: false, preserveDrawingBuffer: true };
    const gl = canvas.getContext("webgl2", options);
    return gl ? new Shader(canvas, gl, restored) : new Processor(canvas);
}

class Shader {
    kind = "WebGL2";

    constructor(canvas, gl, restored) {
        Object.assign(this, { canvas, gl, size: [0, 0] });
        // A restored context has lost program and texture.
        canvas.addEventListener("webglcontextlost", event => event.preventDefault());
        canvas.addEventListener("webglcontextrestored", () => {
            this.size = [0, 0];
            this.#prepare();
            restored();
        });
        this.#prepare();
    }

    #prepare() {
        const { gl } = this;
        const program = gl.createProgram();
        for (const [kind, text] of [[gl.VERTEX_SHADER, CORNERS], [gl.FRAGMENT_SHADER, SHADER]]) {
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, text);
            gl.compileShader(shader);
            gl.attachShader(program, shader);
        }
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
            throw new Error(`the shader does not compile: ${gl.getProgramInfoLog(program)}`);
        }
        gl.useProgram(program);
        this.place = Object.fromEntries(
            ["scale", "mode", "curve", "overlay", "greatest", "isPreview"].map(name => [name, gl.getUniformLocation(program, name)]));
        gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
        for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
            gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
        }
    }

    draw(picture, { mode, scale, curve, overlay, greatest, isPreview = false }) {
        const { gl, canvas, place } = this;
        if (gl.isContextLost()) return;
        this.#upload(picture);
        gl.uniform1f(place.scale, scale);
        gl.uniform1i(place.mode, mode);
        gl.uniform1i(place.curve, CURVES.indexOf(curve));
        gl.uniform1i(place.overlay, overlay);
        gl.uniform1f(place.greatest, greatest);
        gl.uniform1i(place.isPreview, isPreview);
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    #upload(picture) {
        const { gl } = this;
        const [width, height] = picture.size;
        let rows = picture.takeDirty();
        if (width !== this.size[0] || height !== this.size[1]) {
            fitted(this.canvas, picture);
            gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, width, height, 0, gl.RGBA, gl.FLOAT, null);
            this.size = [width, height];
            rows = [0, height];
        }
        if (!rows) return;
        const part = picture.data.subarray(4 * width * rows[0], 4 * width * rows[1]);
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, rows[0], width, rows[1] - rows[0], gl.RGBA, gl.FLOAT, part);
    }
}

class Processor {
    kind = "2D canvas";

    constructor(canvas) {
        Object.assign(this, { canvas, context: canvas.getContext("2d"), tone: "" });
    }

    draw(picture, tone) {
        const { canvas, context } = this;
        const [width, height] = picture.size;
        let rows = picture.takeDirty();
        const asText = JSON.stringify(tone);
        if (canvas.width !== width || canvas.height !== height || asText !== this.tone) {
            fitted(canvas, picture);
            this.tone = asText;
            rows = [0, height];
        }
        if (!rows) return;
        const image = context.createImageData(width, rows[1] - rows[0]);
        for (let to = 0, from = 4 * width * rows[0]; to < image.data.length; to += 4, from += 4) {
            const [red, green, blue, mark] = picture.data.subarray(from, from + 4);
            image.data.set([...marked(codes([red, green, blue], tone), mark, tone), 255], to);
        }
        context.putImageData(image, 0, rows[0]);
    }
}

function fitted(canvas, { size: [width, height] }) {
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
}
