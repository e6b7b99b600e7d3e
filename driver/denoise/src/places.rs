//! Search for the file of Open Image Denoise.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

/// Environment variable that names the file of the library.
pub const VARIABLE: &str = "PHOTONCARD_OIDN";
/// File name of version 2 of the library.
pub(crate) const FILE: &str = if cfg!(windows) {
    "OpenImageDenoise.dll"
} else if cfg!(target_os = "macos") {
    "libOpenImageDenoise.2.dylib"
} else {
    "libOpenImageDenoise.so.2"
};

/// Path from a folder of Python packages (`site-packages`) to the library's folder.
const IN_PACKAGES: &str = "pyoidn/oidn/lib";

/// Returns the path in the environment variable `VARIABLE`; `None` if it is unset or empty.
pub(crate) fn stated() -> Option<PathBuf> {
    let stated = env::var_os(VARIABLE).filter(|stated| !stated.is_empty()).map(PathBuf::from)?;
    // A loader searches its own folders for a bare name.
    Some(std::path::absolute(&stated).unwrap_or(stated))
}

/// Returns the existing library files beside the program and in Python packages, in the order of search.
pub(crate) fn candidates() -> Vec<PathBuf> {
    let program = env::current_exe().ok();
    let beside = program.iter().filter_map(|program| program.parent()).flat_map(|folder| {
        [folder.join(FILE), folder.join("lib").join(FILE), folder.join("../lib").join(FILE)]
    });
    let in_packages = package_folders().into_iter().map(|folder| folder.join(IN_PACKAGES).join(FILE));
    beside.chain(in_packages).filter(|path| path.is_file()).collect()
}

/// Returns the folders of Python packages of the active environment, the user and the system.
fn package_folders() -> Vec<PathBuf> {
    let variable = |name| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let environments = ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter().filter_map(variable);
    let users = variable("HOME").into_iter().map(|home| home.join(".local"));
    let systems = ["/usr/local", "/usr", "/opt/homebrew"].map(PathBuf::from);
    let roots: Vec<PathBuf> = environments.chain(users).chain(systems).collect();
    roots.iter().flat_map(|root| package_folders_in(root)).collect()
}

fn package_folders_in(root: &Path) -> Vec<PathBuf> {
    // Python has one package folder on Windows, elsewhere one per version.
    let mut folders = vec![root.join("Lib/site-packages"), root.join("lib/python3/dist-packages")];
    let mut versions: Vec<PathBuf> = fs::read_dir(root.join("lib"))
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python3.")))
        .collect();
    versions.sort();
    folders.extend(
        versions
            .iter()
            .rev()
            .flat_map(|version| [version.join("site-packages"), version.join("dist-packages")]),
    );
    folders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_of_each_version_of_python_are_searched() {
        let root = tempfile::tempdir().unwrap();
        for version in ["python3.9", "python3.11", "other"] {
            fs::create_dir_all(root.path().join("lib").join(version)).unwrap();
        }
        let found = package_folders_in(root.path());
        let at = |path: &str| root.path().join(path);
        for path in ["lib/python3.9/site-packages", "lib/python3.11/dist-packages", "Lib/site-packages"] {
            assert!(found.contains(&at(path)), "{path}: {found:?}");
        }
        assert!(!found.contains(&at("lib/other/site-packages")));
    }
}
