// Words of a command line, as a shell reads them: quotes and backslashes, no variables.

export function wordsOf(line) {
    const words = [];
    let word = null, quote = "";
    for (let at = 0; at < line.length; at++) {
        const sign = line[at];
        if (quote) {
            if (sign === quote) quote = "";
            else word += sign;
        } else if (sign === "'" || sign === "\"") {
            quote = sign;
            word ??= "";
        } else if (sign === " ") {
            if (word !== null) words.push(word);
            word = null;
        } else {
            word = (word ?? "") + (sign === "\\" ? line[++at] ?? "" : sign);
        }
    }
    return word === null ? words : [...words, word];
}

// The scene and the options of a view in the command line of a render, and how its PNG is shown; null if it is none.
export function viewOf(line) {
    const [program, command, scene, ...rest] = wordsOf(line);
    if (program !== "photoncard" || command !== "render" || !scene) return null;
    const view = { scene, options: [] };
    for (let at = 0; at < rest.length; at++) {
        if (rest[at] === "-o") at++;
        else if (rest[at] === "--exposure") view.exposure = Number(rest[++at]);
        else if (rest[at] === "--tonemap") view.tonemap = rest[++at];
        else view.options.push(rest[at]);
    }
    return view;
}
