//! Fuzzing of photometric files.

use std::path::Path;

use photoncard_driver::scene::LightProfile;

use super::mutation;
use super::random::Random;
use super::target::{Target, bound};

/// Target for photometric files.
pub(super) struct Profiles {
    seeds: Vec<Vec<u8>>,
}

/// Files of LM-63 with and without tilts of the lamp, and a file of EULUMDAT.
fn files() -> Vec<Vec<u8>> {
    let plain = "IESNA:LM-63-2002\n[TEST] 1\nTILT=NONE\n1 900 1.5 3 3 1 2 .1 .1 0\n1 1 9\n0 45 90\n0 45 90\n9 5 1\n8 4 1\n7 3 0\n";
    let tilted =
        "TILT=INCLUDE\n1 2\n0 90\n1 .8\n1,900,1,2,2,2,1,0,0,0\n.9 1 30\n-90 90\n0 60\n10\n20 1e2 40\n";
    let head = "maker\n1\n4\n4\n90\n3\n45\n1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n13\n14\n100\n80\n1\n0\n1\n1\nLED\n900\n3000\n90\n9\n";
    let ratios = ".5\n".repeat(10);
    let eulumdat = format!("{head}{ratios}0\n90\n180\n270\n0\n45\n90\n100\n50\n0\n90\n40\n0\n");
    [plain, tilted, &eulumdat].map(|text| text.as_bytes().to_vec()).to_vec()
}

impl Profiles {
    pub(super) fn new() -> Self {
        Self { seeds: files() }
    }
}

impl Target for Profiles {
    fn name(&self) -> &'static str {
        "profiles"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        // Angles with no common step make an image of 360 by 1,801 texels, whatever their number.
        bound(input, 64)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut file = random.pick(&self.seeds).clone();
        mutation::edit(&mut file, &self.seeds, random);
        file
    }

    fn read(&self, input: &[u8]) -> bool {
        match LightProfile::parse(input, Path::new("lamp.ies")) {
            Ok(profile) => {
                let [width, height] = [profile.image.width, profile.image.height];
                assert_eq!(profile.image.texels.len(), (width * height) as usize);
                assert!(profile.peak > 0.0 && profile.lumens > 0.0 && profile.lumens.is_finite());
                true
            }
            Err(error) => {
                assert!(error.to_string().contains("line "), "{error}");
                false
            }
        }
    }
}
