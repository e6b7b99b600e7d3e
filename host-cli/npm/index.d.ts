/** Contents of a file. */
export type Content = Uint8Array | ArrayBuffer | Blob;

/**
 * A scene: the address of a `.glb`, its bytes, or files by their paths. The first path that ends in `.glb` or `.gltf` is the scene, and the others
 * are files that it or an argument names.
 */
export type Scene = string | URL | Content | Map<string, Content> | Record<string, Content>;

export type Vector = readonly [number, number, number];

export interface Camera {
    /** Name of a camera of the file; its first one by default. */
    name?: string;
    /** Position in the file's coordinates, metres. */
    position?: Vector;
    /** Point in the middle of the picture. */
    lookAt?: Vector;
    /** Direction that is up in the picture. */
    up?: Vector;
    /** Vertical field of view, degrees. */
    fov?: number;
}

export interface Progress {
    /** Mean number of samples of a pixel so far; 0 while the preview is coarse. */
    samples: number;
    /** Number of samples that the picture will have, which pilot renders may change. */
    of: number;
    width: number;
    height: number;
    /** Linear RGB of the picture as far as it has come, row by row from the top: a copy, made when it is read. */
    readonly pixels: Float32Array;
}

export interface Options {
    /** Width and height, pixels: at most 4096 each, and 4,194,304 pixels in all. */
    size?: readonly [number, number];
    /** `good` by default. */
    quality?: "draft" | "good" | "final" | "paper";
    camera?: Camera;
    /** Changes of materials and lights, such as `{ "lamp.intensity": 40 }`: `--set` of the command. */
    set?: Record<string, number | string | Vector>;
    /** Layers in the result and in the EXR, such as `albedo`, `N`, `Z`, `direct` and `indirect`: `--aov` of the command. */
    layers?: readonly string[];
    /** Stops of the PNG; found from the picture by default. */
    exposure?: number;
    /** Tone curve of the PNG, `reinhard` by default. */
    tonemap?: "reinhard" | "aces" | "none";
    /** Further words of `photoncard view`. */
    arguments?: readonly string[];
    /** Number of workers that render; by default that of the processor's threads, at most 16. */
    cards?: number;
    /** Ends the render and its workers; the promise is rejected with the signal's reason. */
    signal?: AbortSignal;
    /** Called about ten times a second, and with each whole preview. */
    progress?: (progress: Progress) => void;
}

export interface Result {
    width: number;
    height: number;
    /** Linear RGB, row by row from the top. */
    pixels: Float32Array;
    /** Three values for each pixel of each layer that was asked for; a layer with one value has it three times. */
    layers: Record<string, Float32Array>;
    /** The command line that renders the same picture, byte for byte. */
    command: string;
    /** What the renderer says about the scene, such as what it leaves out. */
    notices: string[];
    exr(): Promise<Uint8Array>;
    png(): Promise<Uint8Array>;
}

/** Renders a scene in workers of the page, which end with the picture. */
export function render(scene: Scene, options?: Options): Promise<Result>;
