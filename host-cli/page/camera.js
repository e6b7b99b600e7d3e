// Cameras and their moves: pure functions. A camera is {position, look_at} in metres, and one of fov, the
// vertical degrees of a perspective picture, height, the metres of an orthographic one, and angles, the
// degrees of a panorama. The top of its picture is towards +y. It has the lens and the shift of the scene's
// camera `name`.

export const add = (a, b) => a.map((value, axis) => value + b[axis]);
export const sub = (a, b) => a.map((value, axis) => value - b[axis]);
export const scaled = (a, factor) => a.map(value => value * factor);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = a => Math.hypot(...a);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const radians = degrees => degrees * Math.PI / 180;
const clamped = (value, low, high) => Math.min(Math.max(value, low), high);

// Elevation that a turn does not pass: at 90 degrees the top of the picture would jump.
const STEEPEST = 89.5 * Math.PI / 180;
// Greatest coordinate of a camera, metres: a move beyond it is none.
const FARTHEST = 1e9;
// Shortest view from a camera to what it looks at, as a share of its greatest coordinate: single precision
// tells its direction.
const SHORTEST = 1e-3;
// Lowest orthographic picture, metres.
const LOWEST = 1e-6;
// Sine of the angle to the vertical below which a direction counts as vertical, as in the renderer.
const VERTICAL = 1e-6;

// Unit vectors of the picture: right, up, forward.
export function axes({ position, look_at }) {
    const view = sub(look_at, position);
    const forward = scaled(view, 1 / length(view));
    const side = cross(forward, [0, 1, 0]);
    const right = length(side) < VERTICAL ? [1, 0, 0] : scaled(side, 1 / length(side));
    return { right, up: cross(right, forward), forward };
}

function rotated(vector, axis, angle) {
    const [sine, cosine] = [Math.sin(angle), Math.cos(angle)];
    const along = scaled(axis, dot(axis, vector) * (1 - cosine));
    return add(add(scaled(vector, cosine), scaled(cross(axis, vector), sine)), along);
}

const greatest = (...points) => Math.max(...points.flat().map(Math.abs));

// The camera after a shift, which it keeps from where no number would tell its place.
function moved(camera, shift) {
    const there = { ...camera, position: add(camera.position, shift), look_at: add(camera.look_at, shift) };
    return greatest(there.position, there.look_at) <= FARTHEST ? there : camera;
}

// Turn about a point: `yaw` about the vertical, `pitch` about the picture's right, radians. About the
// camera's own position it looks around; about another point, that point stays where it is in the picture.
export function turned(camera, centre, yaw, pitch) {
    const { right, forward } = axes(camera);
    const elevation = Math.asin(clamped(forward[1], -1, 1));
    const allowed = clamped(elevation + pitch, -STEEPEST, STEEPEST) - elevation;
    const turn = point => add(centre, rotated(rotated(sub(point, centre), right, allowed), [0, 1, 0], yaw));
    return { ...camera, position: turn(camera.position), look_at: turn(camera.look_at) };
}

// Height of what the picture shows at a depth, metres.
function shown({ fov, height, angles }, depth) {
    if (height !== undefined) return height;
    return angles ? radians(angles[1]) * depth : 2 * Math.tan(radians(fov) / 2) * depth;
}

// Shift by a drag of pixels, so that what is `depth` metres away follows the pointer. A panorama is shifted
// along the middle's axes.
export function panned(camera, [dx, dy], height, depth) {
    const { right, up } = axes(camera);
    const metres = shown(camera, depth) / height;
    return moved(camera, add(scaled(right, -dx * metres), scaled(up, dy * metres)));
}

// Approach to a point: its distance is multiplied by `factor`, and it stays where it is in the picture. An
// orthographic picture shows less instead.
export function dollied(camera, centre, factor) {
    const way = scaled(sub(centre, camera.position), 1 - factor);
    if (camera.height === undefined) return moved(camera, way);
    const { forward } = axes(camera);
    return moved(zoomed(camera, factor), sub(way, scaled(forward, dot(way, forward))));
}

const isWithin = (point, { low, high }) => point.every((value, axis) => low[axis] <= value && value <= high[axis]);

// Bounds that are smaller by a share of their least side.
function shrunk({ low, high }, share) {
    const margin = share * Math.min(...sub(high, low));
    return { low: low.map(value => value + margin), high: high.map(value => value - margin) };
}

// The space in which a camera stays that is within a room of these bounds; null for a camera outside. A
// camera at its border is inside, however it was rounded.
export const roomOf = ({ position }, bounds) => isWithin(position, shrunk(bounds, 0.01)) ? shrunk(bounds, 0.02) : null;

// The camera after a move, kept in a room. An orbit comes closer to its centre where a wall is in its way;
// other moves end at the wall, or go along it.
export function kept(camera, room, centre = null) {
    const { position, look_at } = camera;
    if (isWithin(position, room)) return camera;
    const hasCentre = centre && isWithin(centre, room);
    const shares = hasCentre ? position.map((value, axis) => {
        const way = value - centre[axis];
        return way === 0 ? 1 : ((way > 0 ? room.high : room.low)[axis] - centre[axis]) / way;
    }) : [];
    const place = hasCentre ? add(centre, scaled(sub(position, centre), Math.min(1, ...shares)))
        : position.map((value, axis) => clamped(value, room.low[axis], room.high[axis]));
    return { ...camera, position: place, look_at: add(place, sub(look_at, position)) };
}

// Flight by metres to the right, upwards (in the world) and forward.
export function flown(camera, [rightward, upward, onward]) {
    const { right, forward } = axes(camera);
    return moved(camera, add(add(scaled(right, rightward), [0, upward, 0]), scaled(forward, onward)));
}

// A panorama has no zoom.
export function zoomed(camera, factor) {
    const { fov, height, angles } = camera;
    if (height !== undefined) return { ...camera, height: clamped(height * factor, LOWEST, FARTHEST) };
    return angles ? camera : { ...camera, fov: clamped(fov * factor, 1, 150) };
}

// Distance of a point along the view's axis.
export const depth = (camera, point) => dot(sub(point, camera.position), axes(camera).forward);

// Place of a point in a picture of a size, pixels; null if it is behind the camera.
export function projected(camera, point, [width, height]) {
    const { right, up, forward } = axes(camera);
    const ray = sub(point, camera.position);
    const [across, above, along] = [dot(ray, right), dot(ray, up), dot(ray, forward)];
    if (camera.angles) {
        const [longitudes, latitudes] = camera.angles.map(radians);
        const [longitude, latitude] = [Math.atan2(across, along), Math.asin(clamped(above / length(ray), -1, 1))];
        return [width * (0.5 + longitude / longitudes), height * (0.5 - latitude / latitudes)];
    }
    if (along <= 0) return null;
    const scale = height / shown(camera, along);
    return [width / 2 + scale * across, height / 2 - scale * above];
}

// Centre of turns while nothing is chosen: on the view's axis, as far away as the middle of the scene.
export function middle(camera, { low, high }) {
    const size = length(sub(high, low));
    const centre = scaled(add(low, high), 0.5);
    const ahead = Math.max(depth(camera, centre), 0.1 * size);
    return add(camera.position, scaled(axes(camera).forward, ahead));
}

// The one of fov, height and angles that a camera has, with `convert` applied to its numbers.
export function extent({ fov, height, angles }, convert) {
    if (height !== undefined) return { height: convert(height) };
    return angles ? { angles: angles.map(convert) } : { fov: convert(fov) };
}

// The camera in single precision, as the renderer has it. From far away it looks at a place farther along its
// view.
export function rounded(camera) {
    const { position, look_at } = camera;
    const least = SHORTEST * greatest(position);
    const isNear = length(sub(look_at, position)) < least;
    const place = isNear ? add(position, scaled(axes(camera).forward, least)) : look_at;
    return { ...camera, position: position.map(Math.fround), look_at: place.map(Math.fround), ...extent(camera, Math.fround) };
}

// The shortest decimal of a number in single precision.
export function shortest(value) {
    const single = Math.fround(value);
    for (let digits = 1; digits < 9; digits++) {
        const text = single.toPrecision(digits);
        if (Math.fround(text) === single) return String(Number(text));
    }
    return String(Number(single.toPrecision(9)));
}

// Options of the command line that place a camera.
export function pose(camera) {
    const { position, look_at } = rounded(camera);
    const { fov, height, angles } = extent(camera, shortest);
    const place = point => point.map(shortest).join(",");
    const name = camera.name === undefined ? "" : `--camera '${camera.name.replaceAll("'", "'\\\'\'")}' `;
    return `${name}--camera-at ${place(position)} --look-at ${place(look_at)} `
        + (height ? `--orthographic ${height}` : angles ? `--panorama ${angles.join(",")}` : `--fov ${fov}`);
}
