//! Scenes of consecutive frames.

use miette::{MietteDiagnostic, Report};
use photoncard_driver::scene::Scene;

use super::steps::assigned;
use crate::arguments::{FrameOptions, SceneOptions};
use crate::failure::Failure;
use crate::input::Input;

/// Scene that is moved from frame to frame.
pub(super) struct Moments<'a> {
    options: &'a SceneOptions,
    frames: &'a FrameOptions,
    input: Input,
    /// Scene at the frame of the last call of `move_to`. Before the first call, it is the scene without
    /// animation if only cameras move, else an empty scene.
    scene: Scene,
    is_still: bool,
}

impl<'a> Moments<'a> {
    /// Opens a scene for cards with `dram_bytes` bytes of memory. Also returns the scene without animation.
    pub(super) fn open(
        options: &'a SceneOptions,
        frames: &'a FrameOptions,
        dram_bytes: u64,
    ) -> Result<(Self, Scene), Failure> {
        let input = Input::open(options, dram_bytes)?;
        check_animations(&input)?;
        let is_still = input.file.only_cameras_move(frames.animations()).map_err(Failure::input)?;
        let rest = assigned(options, input.at_rest()?)?;
        let scene = if is_still { rest.clone() } else { Scene::default() };
        Ok((Self { options, frames, input, scene, is_still }, rest))
    }

    /// Returns whether only cameras move: geometry and lights are equal in all frames.
    pub(super) fn is_still(&self) -> bool {
        self.is_still
    }

    /// Scene at the frame of the last call of [`Self::move_to`].
    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Moves the scene to a frame. If only cameras move, all other contents and their checksums are kept.
    pub(super) fn move_to(&mut self, number: u32) -> Result<(), Failure> {
        let moment = self.frames.moment(number);
        if !self.is_still {
            self.scene = assigned(self.options, self.input.at(&moment)?)?;
            return Ok(());
        }
        let cameras = self.input.file.cameras_at(&moment).map_err(Failure::input)?;
        // A scene without cameras of its own keeps the camera that it has at rest.
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
