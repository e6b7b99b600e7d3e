//! Prints the corners of all triangles of a glTF scene at a time of its animations, one triangle per line:
//!
//! ```text
//! poses SCENE SECONDS [ANIMATION ...]
//! ```

use std::error::Error;
use std::io::{BufWriter, Write as _, stdout};
use std::path::Path;

use photoncard_driver::scene::gltf::{LoadSettings, Moment, SceneFile};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scene), Some(seconds)) = (arguments.next(), arguments.next()) else {
        return Err("usage: poses SCENE SECONDS [ANIMATION ...]".into());
    };
    let moment = Moment { animations: arguments.collect(), seconds: seconds.parse()? };
    let file = SceneFile::open(Path::new(&scene), &LoadSettings::default())?;
    let mut out = BufWriter::new(stdout().lock());
    for triangle in &file.at(&moment)?.triangles {
        let numbers = triangle.vertices.iter().flat_map(glam::Vec3::to_array);
        let numbers: Vec<_> = numbers.map(|number| number.to_string()).collect();
        writeln!(out, "{}", numbers.join(" "))?;
    }
    out.flush()?;
    Ok(())
}
