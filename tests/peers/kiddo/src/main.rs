//! Search for the nearest photons by kiddo: `kiddo FOLDER [REPEAT]`. The folder contains the output of `cargo
//! run --release -p photoncard-tests --example nearest -- --write FOLDER`.

use std::error::Error;
use std::num::NonZero;
use std::path::Path;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rustix::time::{ClockId, clock_gettime};

const NEIGHBORS: NonZero<usize> = NonZero::new(100).unwrap();
const MAX_DISTANCE: f32 = 0.025;

/// Processor time of this thread, seconds. It excludes other processes.
fn cpu_seconds() -> f64 {
    let taken = clock_gettime(ClockId::ThreadCPUTime);
    taken.tv_sec as f64 + taken.tv_nsec as f64 * 1e-9
}

fn read(path: &Path) -> Result<Vec<[f32; 3]>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let (coordinates, _) = bytes.as_chunks::<4>();
    let coordinates: Vec<f32> = coordinates.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    Ok(coordinates.as_chunks().0.to_vec())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("name the folder of points and queries")?;
    let repeat: usize = arguments.next().map_or(Ok(3), |repeat| repeat.parse())?;
    let folder = Path::new(&folder);
    let points = read(&folder.join("points"))?;
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(&points)?;
    for name in ["random", "hilbert"] {
        let queries = read(&folder.join(name))?;
        let mut seconds = Vec::new();
        let mut sum = 0.0;
        for _ in 0..repeat {
            let start = cpu_seconds();
            sum = 0.0;
            for query in &queries {
                let found = tree
                    .query(query)
                    .nearest_n::<SquaredEuclidean<f32>>(NEIGHBORS)
                    .within(MAX_DISTANCE * MAX_DISTANCE)
                    .unsorted()
                    .execute();
                sum += found.iter().map(|item| f64::from(item.distance)).sum::<f64>();
            }
            seconds.push(cpu_seconds() - start);
        }
        seconds.sort_by(f64::total_cmp);
        let median = seconds[seconds.len() / 2];
        println!("kiddo {name}: {:.0} searches a second; sum {sum:.9}", queries.len() as f64 / median);
    }
    Ok(())
}
