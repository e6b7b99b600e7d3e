// Properties of the page's modules that need no picture. The value is a list of what does not hold.
(async () => {
    const camera = await import("/camera.js");
    const { Pace } = await import("/pace.js");
    const { Picture } = await import("/picture.js");
    const { decoded } = await import("/tiles.js");
    const tone = await import("/tone.js");
    const { hexOf, linearOf } = await import("/fields.js");
    const { History } = await import("/history.js");
    const { histogram } = await import("/inspector.js");
    const { fileOf } = await import("/tiles.js");
    const { Zoom } = await import("/zoom.js");

    const faults = [];
    const check = (holds, what) => holds || faults.push(what);
    const near = (a, b, tolerance = 1e-9) => [a].flat().every((value, at) => Math.abs(value - [b].flat()[at]) <= tolerance);
    let seed = 1;
    const random = () => (seed = seed * 48271 % 2147483647) / 2147483647;
    const point = () => [0, 1, 2].map(() => 8 * random() - 4);

    for (let round = 0; round < 200; round++) {
        const view = { position: point(), look_at: point(), fov: 20 + 80 * random() };
        const size = [320, 200];
        const { right, up, forward } = camera.axes(view);
        check(near([camera.dot(right, up), camera.dot(up, forward), right[1]], [0, 0, 0]), "axes are upright");
        check(near(camera.projected(view, view.look_at, size), [160, 100], 1e-6), "the middle is what is looked at");

        // A point in the picture stays where it is while the camera turns about it or comes closer.
        const centre = camera.add(view.position, camera.add(camera.scaled(forward, 2), camera.scaled(right, random() - 0.5)));
        const place = camera.projected(view, centre, size);
        const orbited = camera.turned(view, centre, 6 * random() - 3, 0.2 * random() - 0.1);
        check(near(camera.projected(orbited, centre, size), place, 1e-6), "the centre of an orbit stays");
        check(near(camera.projected(camera.dollied(view, centre, 0.5), centre, size), place, 1e-6), "so does that of a dolly");
        const panned = camera.panned(view, [7, -4], size[1], camera.depth(view, centre));
        check(near(camera.projected(panned, centre, size), camera.add(place, [7, -4]), 1e-6), "a pan follows the pointer");
        const looked = camera.turned(view, view.position, 1, 9);
        check(near(looked.position, view.position) && camera.axes(looked).up[1] > 0, "a turn stops before the zenith");
        const flown = camera.flown(view, [0, 0, 3]);
        check(near(flown.position, camera.add(view.position, camera.scaled(forward, 3))), "a flight is along the view");

        // By parallel rays and in a panorama too, what is pointed at stays.
        const parallel = { position: view.position, look_at: view.look_at, height: 1 + 4 * random() };
        const around = { position: view.position, look_at: view.look_at, angles: [360, 180] };
        for (const other of [parallel, around]) {
            const there = camera.projected(other, centre, size);
            check(near(camera.projected(camera.dollied(other, centre, 0.5), centre, size), there, 1e-6), "a dolly keeps its centre");
            // The top of a turned panorama stays +y, so that what is beside its middle moves.
            if (other === around) continue;
            const turned = camera.turned(other, centre, 2 * random() - 1, 0.2 * random() - 0.1);
            check(near(camera.projected(turned, centre, size), there, 1e-6), "an orbit keeps its centre");
        }
        const along = camera.panned(parallel, [7, -4], size[1], 1);
        check(near(camera.projected(along, centre, size), camera.add(camera.projected(parallel, centre, size), [7, -4]), 1e-6),
            "a pan of parallel rays follows the pointer");
        check(near(camera.zoomed(parallel, 2).height, 2 * parallel.height) && camera.zoomed(around, 2) === around, "zooms");
        check(camera.pose(around).endsWith("--panorama 360,180"), "options of a panorama");

        const value = Math.fround(10 ** (20 * random() - 10));
        const text = camera.shortest(value);
        check(Math.fround(text) === value, `${value} is printed as ${text}`);
    }
    // However far a camera is moved, the command can have it, and it sees what it saw.
    const start = { position: [0, 1, 4], look_at: [0.5, 1, 1], fov: 40 };
    const rest = camera.axes(start).forward;
    for (const [how, move] of [
        ["dolly", view => camera.dollied(view, [0, 1, 0], 2.7)], ["pan", view => camera.panned(view, [90, 90], 200, 1e8)],
        ["flight", view => camera.flown(view, [1e7, 0, -1e7])], ["no number", view => camera.flown(view, [NaN, 0, 0])],
    ]) {
        let view = start;
        for (let round = 0; round < 300; round++) view = move(view);
        const sent = camera.rounded(view);
        check([sent.position, sent.look_at].flat().every(value => Math.abs(value) <= 1e9 * 1.01), `a ${how} ends: ${sent.position}`);
        check(near(camera.axes(sent).forward, rest, 1e-3), `a ${how} keeps the direction: ${camera.axes(sent).forward}`);
    }
    check(camera.shortest(0.1) === "0.1" && camera.shortest(-2) === "-2", "short numbers stay short");
    check(camera.projected({ position: [0, 0, 0], look_at: [0, 0, -1], fov: 40 }, [0, 0, 1], [9, 9]) === null, "nothing is behind");

    // Tiles: [version, step, x, y, columns, rows, samples, card, gathers, records, lines] and pixels.
    const message = (head, pixels) => {
        const buffer = new ArrayBuffer(44 + 4 * pixels.length);
        head.forEach((word, at) => new DataView(buffer).setUint32(4 * at, word, true));
        pixels.forEach((value, at) => new DataView(buffer).setFloat32(44 + 4 * at, value, true));
        return buffer;
    };
    check(decoded(new ArrayBuffer(43)) === null && decoded(message([1, 1, 0, 0, 2, 2, 1, 0], [0])) === null, "lengths are checked");
    check(decoded(message([1, 0, 0, 0, 1, 1, 1, 0], [1, 2, 3])) === null, "a step of 0 is refused");
    const picture = new Picture([5, 3]);
    const coarse = [1, 2, 3, 4, 5, 6].flatMap(value => [value, value, value]);
    check(picture.put(decoded(message([7, 2, 0, 0, 3, 2, 1, 0], coarse))) && picture.isWhole, "a coarse picture is whole");
    const reds = () => Array.from({ length: 15 }, (_, at) => picture.data[4 * at]).join("");
    check(reds() === "112231122344556", `coarse pixels are repeated: ${reds()}`);
    check(!picture.put(decoded(message([6, 1, 0, 0, 1, 1, 1, 0], [9, 9, 9]))), "an older tile is left");
    check(picture.put(decoded(message([7, 1, 4, 2, 1, 1, 1, 0], [9, 9, 9]))) && !picture.isWhole, "a finer one is taken");
    check(!picture.put(decoded(message([7, 2, 0, 0, 3, 2, 1, 0], coarse))), "a coarser one of the same picture is left");
    check(reds() === "112231122344559", `one pixel is finer: ${reds()}`);
    check(!picture.put(decoded(message([8, 1, 5, 0, 1, 1, 1, 0], [9, 9, 9]))), "a tile outside is left");
    check(picture.whole.version === 7 && picture.whole.step === 2 && !picture.isFirst, "the last whole picture is known");

    // Marks of an overlay: those of new tiles, whose greatest one counts.
    picture.mark(({ gathers, lines }) => [lines >= 0 ? lines : gathers, 99]);
    check(picture.greatest < 0 && picture.markAt([0, 0]) < 0, "another overlay begins without marks");
    picture.restart(7);
    const heads = [[7, 1, 0, 0, 5, 2, 1, 0, 50, 0, 0xffffffff], [7, 1, 0, 2, 5, 1, 1, 0, 20, 0, 40], [8, 1, 0, 0, 5, 3, 1, 0, 10, 0, 0xffffffff]];
    const marked = heads.map(head => {
        picture.put(decoded(message(head, Array(3 * head[4] * head[5]).fill(1))));
        return [picture.markAt([3, 1]), picture.markAt([3, 2]), picture.markAt([0, 1]), picture.greatest].join();
    });
    check(marked.join(" ") === "50,-1,99,50 50,99,99,50 10,10,99,10", `marks are those of tiles: ${marked.join(" ")}`);
    picture.data[4 * 14] = 9;
    picture.resize([10, 3]);
    check(picture.data[4 * 29] === 9 && picture.data.length === 120, "another size stretches the picture");

    // A drawing that can wait comes once, later; any other in the next frame.
    const drawn = [];
    const pace = new Pace(() => drawn.push(performance.now()));
    const frames = count => count === 0 ? null : new Promise(requestAnimationFrame).then(() => frames(count - 1));
    pace.soon();
    pace.soon();
    await frames(2);
    check(drawn.length === 1 && !pace.isWaiting, "one of several wishes is granted");
    for (let round = 0; round < 5; round++) pace.later();
    check(pace.isWaiting, "a drawing that can wait is not forgotten");
    while (pace.isWaiting) await frames(1);
    check(drawn.length === 2 && drawn[1] - drawn[0] >= 99, `it waits: ${drawn}`);
    pace.later();
    pace.soon();
    await frames(2);
    check(drawn.length === 3 && !pace.isWaiting, "one that cannot wait takes its place");

    // A room keeps the camera: an orbit comes closer to its centre, other moves end at the wall.
    const bounds = { low: [-2, 0, -1], high: [2, 2, 1] };
    const room = camera.roomOf({ position: [0, 1, 0] }, bounds);
    check(room && camera.roomOf({ position: [0, 1, 1.2] }, bounds) === null, "a camera outside has no room");
    for (let round = 0; round < 200; round++) {
        const view = { position: point(), look_at: point(), fov: 50 };
        const centre = [random() - 0.5, 1, random() - 0.5];
        const [orbit, move] = [camera.kept(view, room, centre), camera.kept(view, room)];
        check([orbit, move].every(kept => camera.roomOf(kept, bounds)), "it stays inside");
        const way = camera.sub(view.position, centre), short = camera.sub(orbit.position, centre);
        check(near(camera.scaled(way, camera.length(short) / camera.length(way)), short, 1e-9), "an orbit keeps the line to its centre");
        check(near(camera.axes(view).forward, camera.axes(orbit).forward), "the camera looks where it did");
    }

    // Undo and redo.
    const history = new History();
    for (const fov of [1, 2, 2, 3]) history.note({ fov });
    check(history.undone().fov === 2 && history.undone().fov === 1 && history.undone() === null, "cameras are undone");
    check(history.redone().fov === 2 && history.canRedo, "and redone");
    history.note({ fov: 2 });
    check(history.canRedo, "a camera that was visited forgets none");
    history.note({ fov: 4 });
    check(!history.canRedo && history.undone().fov === 2, "another one forgets those that were undone");

    // Zoom about a point, which stays; no edge of a larger picture comes inside.
    const zoom = new Zoom();
    check(near(zoom.place([100, 80], [100, 50]), [0, 15, 100, 50]), "a fitted picture is in the middle");
    zoom.by(4, [25, 40], [100, 80], [100, 50]);
    check(near(zoom.place([100, 80], [100, 50]), [-75, -60, 400, 200], 1e-6), "the point stays");
    zoom.shift([900, -900], [100, 50]);
    check(near(zoom.place([100, 80], [100, 50]), [0, -120, 400, 200], 1e-6), "the edges stay outside");

    // Files, and what is no file.
    const sent = new Uint8Array([255, 255, 255, 255, 2, 0, 0, 0, 97, 98, 7, 8]);
    const file = fileOf(sent.buffer);
    check(file.name === "ab" && file.bytes.join() === "7,8", "a file has name and bytes");
    check(fileOf(sent.slice(0, 9).buffer) === null && fileOf(new Uint8Array(44).buffer) === null, "a tile is no file");
    check(decoded(sent.buffer) === null, "a file is no tile");

    // A histogram in stops about middle grey.
    const greys = new Float32Array([0.18, 0.36, 0, 0, 0, 0, 0, 0, 90, 90, 90, 0, 0.18, 0.18, 0.18, 0]);
    const counted = histogram(greys, { mode: tone.MODES.light, scale: 1, curve: "none" });
    check(counted.black === 0.25 && counted.clipped === 0.25, `black ${counted.black}, clipped ${counted.clipped}`);
    check(counted.bars[0][40] === 0.5 && counted.bars[1][44] === 0.25 && counted.bars[2][63] === 0.25, "a stop is four bars");

    // Tone mapping, with the values that `photoncard tonemap` has.
    const grey = (curve, value) => tone.codes([value, value, value], { mode: tone.MODES.light, scale: 1, curve })[1];
    for (const [linear, code] of [[0, 0], [0.003, 10], [0.18, 118], [0.5, 188], [1, 255], [7, 255], [-1, 0], [Infinity, 255]]) {
        check(grey("none", linear) === code, `${linear} is ${grey("none", linear)}, not ${code}`);
    }
    check(grey("reinhard", 4) === 255 && grey("reinhard", 1e30) === 255 && grey("aces", Infinity) === 255, "the sun is white");
    check(grey("reinhard", NaN) === 0, "what is no number is black");
    const lit = new Float32Array([1, 1, 1, 0, 4, 4, 4, 0, 0, 0, 0, 0, Infinity, 1, 1, 0]);
    check(near(tone.automaticScale(lit), 0.09, 1e-8), "the log-average of lit pixels becomes middle grey");
    const mapped = (overlay, mark) => tone.marked([100, 100, 100], mark, { overlay, greatest: 8 }).join();
    check(mapped(tone.OVERLAYS.none, 3) === "100,100,100" && mapped(tone.OVERLAYS.heat, -1) === "100,100,100", "what has no mark stays");
    check(mapped(tone.OVERLAYS.heat, 0) === "35,35,35" && mapped(tone.OVERLAYS.heat, 99) === "201,201,201", "heat is from black to white");
    check(tone.automaticScale(new Float32Array(8)) === 1, "a black picture stays");
    check([0, 1, 127, 255].every(code => {
        const hex = `#${code.toString(16).padStart(2, "0").repeat(3)}`;
        return hexOf(linearOf(hex)) === hex;
    }), "colours come back from their codes");
    return faults;
})()
