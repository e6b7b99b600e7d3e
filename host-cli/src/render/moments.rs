//! The scene of each frame.

use miette::{MietteDiagnostic, Report};
use photoncard_driver::scene::{FixedScene, Scene};

use super::steps::assigned;
use crate::arguments::{FrameOptions, SceneOptions};
use crate::failure::Failure;
use crate::input::Input;

/// A scene at one moment of its animations after another.
pub(super) struct Moments<'a> {
    options: &'a SceneOptions,
    frames: &'a FrameOptions,
    input: Input,
    /// The scene of the last frame; at first that at rest, if nothing but cameras moves.
    scene: FixedScene<'static>,
    is_still: bool,
}

impl<'a> Moments<'a> {
    /// Opens a scene for cards of `dram_bytes`. Returns it at rest as well.
    pub(super) fn open(
        options: &'a SceneOptions,
        frames: &'a FrameOptions,
        dram_bytes: u32,
    ) -> Result<(Self, Scene), Failure> {
        let input = Input::open(options, dram_bytes)?;
        check_animations(&input)?;
        let is_still = input.file.only_cameras_move(frames.animations()).map_err(Failure::input)?;
        let rest = assigned(options, input.at_rest()?)?;
        let scene = if is_still { rest.clone() } else { Scene::default() }.into();
        Ok((Self { options, frames, input, scene, is_still }, rest))
    }

    /// Returns whether every frame has the geometry and the lights of the others.
    pub(super) fn is_still(&self) -> bool {
        self.is_still
    }

    /// The scene of the last frame.
    pub(super) fn scene(&self) -> &FixedScene<'static> {
        &self.scene
    }

    /// Places the scene as it is in a frame. Where nothing but cameras moves, all else of it stays.
    pub(super) fn move_to(&mut self, number: u32) -> Result<(), Failure> {
        let moment = self.frames.moment(number);
        if !self.is_still {
            self.scene = assigned(self.options, self.input.at(&moment)?)?.into();
            return Ok(());
        }
        let cameras = self.input.file.cameras_at(&moment).map_err(Failure::input)?;
        // Without cameras in the file the scene is seen as at rest.
        if !cameras.is_empty() {
            self.scene.set_cameras(cameras);
        }
        Ok(())
    }
}

/// Checks that the file has animations.
fn check_animations(input: &Input) -> Result<(), Failure> {
    if input.file.is_animated() {
        return Ok(());
    }
    let report = MietteDiagnostic::new("the scene has no animations, and all of its frames are alike");
    Err(Failure::Input(Report::new(
        report.with_help("leave out --frames, or export the scene with its animations"),
    )))
}
