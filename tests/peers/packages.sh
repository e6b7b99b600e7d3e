# Sourced by the scripts that render glTF files of others: packages of crates.io, npm and PyPI that ship such files, of fixed versions
# and checksums. They are kept below cargo's target folder and have licences of their own.

for tool in curl tar python3 sha256sum base64; do
    command -v "$tool" >/dev/null || {
        echo "$0: $tool is missing; install it with the system's package manager" >&2
        exit 1
    }
done
package_folder=$(realpath -m "${CARGO_TARGET_DIR:-target}")/peers/real-files

# Package, address, SHA-256.
packages() {
    local crates=https://static.crates.io/crates npm=https://registry.npmjs.org pypi=https://files.pythonhosted.org/packages
    cat <<END
bevy_webgl2 $crates/bevy_webgl2/bevy_webgl2-0.4.0.crate 32c54dfd3fc5578ae6a8dac06cbdcddd850baf68d7cd96a34ac95b80eb9a9835
easy-gltf $crates/easy-gltf/easy-gltf-1.1.4.crate b6cc16292992ce0d4874c93dbe7ef3b0a47a72234e797c1eeb10d73a1b9d7b73
bevy_mod_raycast $crates/bevy_mod_raycast/bevy_mod_raycast-0.18.0.crate d9e4ff45885c4716771a9f55977d8ce69596502a5241da55bf608d7cd71a9cb3
bevy_mod_outline $crates/bevy_mod_outline/bevy_mod_outline-0.13.0.crate 97f2e45781f64d23a3fecfd86d13efbb5256832b8091fe3b48cecd5875c538b9
bevy_fps_controller $crates/bevy_fps_controller/bevy_fps_controller-20.0.0.crate 3920a91ddd7c8d9481158be05687adbdd8e266deeab20416d6d5f2481e9f151f
webxr-assets $npm/@webxr-input-profiles/assets/-/assets-1.0.20.tgz 30df2a2268220fc0d0e034bed1550aabdd7a2500573c5216f64fc70d59c3d91e
pmndrs-assets $npm/@pmndrs/assets/-/assets-1.7.0.tgz 152bd218a3390703f184f0c6ce16e73c8f0a87f32d38530d418a09d33d8208dc
gradio $pypi/17/03/c1fdcfe84d1dce2a75921654e7b2075b251f7d48904d2b6006a2556a16b5/gradio-6.31.0-py3-none-any.whl 7b50b9b6a2d23cd02851ad4c8b1c8312c88d8b911d1f29c93f9761c98348a64a
genesis-world $pypi/eb/85/45b33ceb7cdab11b53d3e706e8db21b9394b756214885d087a053d0286d9/genesis_world-1.4.5-py3-none-any.whl 7ce8fcc8b0af9a87907e550b5f373b27af3f6ca622e843ce12dc51e8a93a03fd
END
}

# Name, package, path inside it, and its light: "own", or "white" of an environment; or "refused", and what the error says.
files() {
    local profiles=package/dist/profiles
    cat <<END
flight-helmet bevy_webgl2 bevy_webgl2-0.4.0/assets/models/FlightHelmet/FlightHelmet.gltf white
duck gradio gradio/media_assets/models3d/Duck.glb white
fox gradio gradio/media_assets/models3d/Fox.gltf white
fox-glb bevy_mod_outline bevy_mod_outline-0.13.0/assets/Fox.glb white
morph-stress bevy_mod_outline bevy_mod_outline-0.13.0/assets/MorphStressTest.gltf white
hollow bevy_mod_outline bevy_mod_outline-0.13.0/assets/hollow.glb white
monkey bevy_mod_raycast bevy_mod_raycast-0.18.0/assets/models/monkey/Monkey.gltf white
playground bevy_fps_controller bevy_fps_controller-20.0.0/assets/playground.glb white
cube easy-gltf easy-gltf-1.1.4/tests/cube.glb own
cube-classic easy-gltf easy-gltf-1.1.4/tests/cube_classic.gltf own
cube-colour easy-gltf easy-gltf-1.1.4/tests/cube_color.glb white
head easy-gltf easy-gltf-1.1.4/tests/head.glb own
complete easy-gltf easy-gltf-1.1.4/tests/complete.glb own
box-sparse easy-gltf easy-gltf-1.1.4/tests/box_sparse.glb white
chopping-board genesis-world genesis/assets/meshes/chopping-board/source/chopping_board.glb white
trash-bag genesis-world genesis/assets/meshes/trashbag_rope.glb white
camera genesis-world genesis/assets/meshes/camera/camera.glb white
ball genesis-world genesis/assets/tower/ball.glb white
ring genesis-world genesis/assets/tower/ring_01.glb white
valve-index webxr-assets $profiles/valve-index/left.glb white
galaxy-xr webxr-assets $profiles/samsung-galaxyxr/left.glb white
magicleap webxr-assets $profiles/magicleap-two/none.glb white
vive-cosmos webxr-assets $profiles/htc-vive-cosmos/left.glb white
trigger webxr-assets $profiles/generic-trigger-squeeze/none.glb white
pico webxr-assets $profiles/pico-4u/left.glb white
hand webxr-assets $profiles/generic-hand/left.glb white
suzi-draco pmndrs-assets package/models/suzi.glb white
END
}

# The path of a file of a package, fetched if it is not there. Failures are returned, as a substitution does not end at them: 75 if the network fails.
package_file() {
    local name=$1 path=$2 address checksum
    read -r _ address checksum < <(packages | grep "^$name ")
    fetch "$name" "$address" "$checksum" >&2 || return
    echo "$package_folder/$name/$path"
}

fetch() {
    local name=$1 address=$2 checksum=$3
    local archive=$package_folder/packages/$name-${checksum:0:8} partial=$package_folder/$name.partial
    mkdir -p "$package_folder/packages" || return
    if [ ! -e "$archive" ]; then
        curl --fail --silent --show-error --location --output "$archive.partial" "$address" || return 75
        echo "$checksum  $archive.partial" | sha256sum --check --quiet || return
        mv "$archive.partial" "$archive" || return
    fi
    [ -d "$package_folder/$name" ] && return
    mkdir -p "$partial" || return
    case $address in
        *.whl) python3 -m zipfile -e "$archive" "$partial" || return ;;
        *) tar -xzf "$archive" -C "$partial" || return ;;
    esac
    # This package keeps each model as a JavaScript module around a data URI.
    if [ "$name" = pmndrs-assets ]; then
        local module
        for module in "$partial"/package/models/*.glb.js; do
            sed 's/.*base64,\([A-Za-z0-9+\/=]*\).*/\1/' "$module" | base64 --decode >"${module%.js}" || return
        done
    fi
    mv "$partial" "$package_folder/$name"
}
