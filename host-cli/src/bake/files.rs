//! Files of a bake: the glb, and the pages beside it.

use std::path::{Path, PathBuf};

use photoncard_driver::exr::{self, ExrError};
use photoncard_driver::output;
use photoncard_driver::render::bake::{BakeError, Baked, MaterialForm, Plan, write};

use crate::arguments::BakeOptions;
use crate::failure::Failure;
use crate::outputs;

/// Files that a bake writes.
pub(super) struct Files {
    glb: PathBuf,
    form: MaterialForm,
    /// A file for each page; none if they are not requested.
    exr: Vec<PathBuf>,
    rgbm: Vec<PathBuf>,
}

impl Files {
    /// Files of a bake with a number of pages.
    ///
    /// # Errors
    /// If one cannot be written.
    pub(super) fn new(options: &BakeOptions, pages: u32) -> Result<Self, Failure> {
        let of_pages = |is_requested: bool, ending: &str| -> Vec<PathBuf> {
            let pages = if is_requested { pages } else { 0 };
            let path = |page| options.output.with_extension(format!("{page}.{ending}"));
            (0..pages).map(path).collect()
        };
        let files = Self {
            glb: options.output.clone(),
            form: options.files.materials,
            exr: of_pages(options.files.exr, "exr"),
            rgbm: of_pages(options.files.rgbm, "png"),
        };
        let beside: Vec<&Path> = files.exr.iter().chain(&files.rgbm).map(PathBuf::as_path).collect();
        outputs::check(&crate::input::files(&options.scene), &beside, &[&files.glb])?;
        Ok(files)
    }

    /// Writes all files, the glb last.
    ///
    /// # Errors
    /// If a page cannot be encoded, or a file cannot be written.
    pub(super) fn write(&self, plan: &Plan, baked: &Baked) -> Result<(), BakeError> {
        for (path, page) in self.exr.iter().zip(&baked.irradiance) {
            let pixels: Vec<[f32; 3]> = page.values.iter().map(glam::Vec3::to_array).collect();
            let failed = |error: ExrError| BakeError::Encode { what: "EXR", reason: error.to_string() };
            output::write(path, &exr::square_bytes(path, page.size, &pixels).map_err(failed)?)?;
        }
        let rgbm = if self.rgbm.is_empty() { Vec::new() } else { baked.rgbm()? };
        for (path, bytes) in self.rgbm.iter().zip(rgbm) {
            output::write(path, &bytes)?;
        }
        let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let names: Vec<String> = self.rgbm.iter().map(name).collect();
        output::write(&self.glb, &write(plan, baked, self.form, &names)?)?;
        Ok(())
    }
}
