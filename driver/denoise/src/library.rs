//! Functions of Open Image Denoise 2, safe calls of them, and their errors.
#![expect(unsafe_code, reason = "functions of a C library, loaded at run time")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr;

#[cfg(not(target_family = "wasm"))]
use libloading::{Error as LoadError, Library as Loaded};
use thiserror::Error;

#[cfg(target_family = "wasm")]
use crate::no_loader::{Error as LoadError, Library as Loaded};
use crate::places::{FILE, VARIABLE};

/// `OIDN_DEVICE_TYPE_CPU`. A GPU would be faster, but rounds differently and can be busy.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;
/// `OIDN_ERROR_CANCELLED`.
const CANCELLED: c_int = 6;

type Handle = *mut c_void;
/// `OIDNProgressMonitorFunction`: returns false to cancel the filter.
type Monitor = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// Function that returns true when the denoiser must stop. The library calls it on any of its threads.
pub type MustStop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Quality of a filter; a higher quality takes more time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quality {
    /// `OIDN_QUALITY_BALANCED`: a smaller network, two to three times as fast.
    Balanced = 5,
    /// `OIDN_QUALITY_HIGH`.
    High = 6,
}

/// Kind of a filter: its network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// `RT`, for rendered pictures.
    Picture,
    /// `RTLightmap`, for lightmaps of irradiance.
    Lightmap,
}

impl Kind {
    fn name(self) -> &'static CStr {
        match self {
            Self::Picture => c"RT",
            Self::Lightmap => c"RTLightmap",
        }
    }
}

/// Input of a filter.
pub(crate) struct Input<'a> {
    pub(crate) kind: Kind,
    /// Name of each image, such as `albedo`, as the library expects it, and the image's pixels.
    pub(crate) images: &'a [(&'a str, &'a [[f32; 3]])],
    /// Names of boolean parameters that are true.
    pub(crate) switches: &'a [&'a str],
    pub(crate) quality: Quality,
}

/// Error of loading or running the denoiser.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DenoiseError {
    /// No file of the library was found.
    #[error(
        "Open Image Denoise 2 is not on this machine; install it, such as by: pip install pyoidn, or name its file {} by {VARIABLE}",
        FILE
    )]
    Missing,
    /// The file is no library for this machine, or lacks a function of version 2.
    #[error("cannot load Open Image Denoise from {}: {reason}; version 2 for this processor is needed", path.display())]
    Unusable {
        /// Path of the library.
        path: PathBuf,
        /// Error of the operating system's loader.
        reason: String,
    },
    /// The library has failed.
    #[error(
        "Open Image Denoise has failed: {reason}; leave out the denoiser, or use another version of its library"
    )]
    Failed {
        /// Error message of the library.
        reason: String,
    },
    /// The caller stopped the denoiser.
    #[error("the denoiser was stopped")]
    Stopped,
    /// Pixels of the film were never written.
    #[error("{missing} pixels of the picture are missing; it is denoised when it is complete")]
    Incomplete {
        /// Number of the pixels.
        missing: usize,
    },
}

/// Declares the functions that are used, by their names in C without the prefix `oidn`.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The loaded library, with the addresses of its functions.
        pub(crate) struct Library {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
            // The addresses hold as long as this is loaded.
            _loaded: Loaded,
        }

        impl Library {
            fn bind(loaded: Loaded) -> Result<Self, LoadError> {
                // SAFETY: the types are those of `OpenImageDenoise/oidn.h`, which version 2 keeps.
                $(let $field = unsafe { *loaded.get(concat!("oidn", $name, "\0").as_bytes())? };)*
                Ok(Self { $($field,)* _loaded: loaded })
            }
        }
    };
}

functions! {
    new_device = "NewDevice": fn(c_int) -> Handle;
    set_device_int = "SetDeviceInt": fn(Handle, *const c_char, c_int);
    set_device_bool = "SetDeviceBool": fn(Handle, *const c_char, bool);
    device_int = "GetDeviceInt": fn(Handle, *const c_char) -> c_int;
    commit_device = "CommitDevice": fn(Handle);
    device_error = "GetDeviceError": fn(Handle, *mut *const c_char) -> c_int;
    release_device = "ReleaseDevice": fn(Handle);
    new_filter = "NewFilter": fn(Handle, *const c_char) -> Handle;
    set_image = "SetSharedFilterImage": fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_filter_bool = "SetFilterBool": fn(Handle, *const c_char, bool);
    set_filter_int = "SetFilterInt": fn(Handle, *const c_char, c_int);
    set_monitor = "SetFilterProgressMonitorFunction": fn(Handle, Monitor, *mut c_void);
    commit_filter = "CommitFilter": fn(Handle);
    execute_filter = "ExecuteFilter": fn(Handle);
    release_filter = "ReleaseFilter": fn(Handle);
}

impl Library {
    /// Loads the library from a file. The error is the message of the operating system's loader.
    pub(crate) fn open(path: &Path) -> Result<Self, String> {
        // SAFETY: loading runs the library's initialisers, which its user has chosen to trust.
        let loaded = unsafe { Loaded::new(path) };
        loaded.and_then(Self::bind).map_err(|error| match std::error::Error::source(&error) {
            Some(source) => source.to_string(),
            None => error.to_string(),
        })
    }
}

/// Device on which the library runs: this machine's processor.
pub(crate) struct Device<'a> {
    library: &'a Library,
    handle: Handle,
}

impl<'a> Device<'a> {
    /// Opens the processor for at most `threads` threads; `None` for one per core.
    pub(crate) fn new(library: &'a Library, threads: Option<usize>) -> Result<Self, DenoiseError> {
        // SAFETY: the function has no preconditions.
        let handle = unsafe { (library.new_device)(CPU) };
        let device = Self { library, handle };
        if handle.is_null() {
            return Err(device.error().unwrap_or_else(|| failed("it has no device")));
        }
        let threads = threads.and_then(|threads| c_int::try_from(threads).ok()).unwrap_or(0);
        // SAFETY: `handle` is a device, and the names end in 0. Threads are not bound to cores, because other
        // threads of this process can be busy there.
        unsafe {
            (library.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (library.set_device_bool)(handle, c"setAffinity".as_ptr(), false);
            (library.commit_device)(handle);
        }
        device.check()?;
        Ok(device)
    }

    /// Name and version of the library.
    pub(crate) fn version(&self) -> String {
        // SAFETY: `handle` is a device, and the name ends in 0.
        let version = unsafe { (self.library.device_int)(self.handle, c"version".as_ptr()) };
        format!("OIDN {}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
    }

    /// Runs the filter on images of `size` (width, height) pixels. Returns the output image.
    pub(crate) fn run(
        &self,
        size: [usize; 2],
        input: &Input,
        must_stop: MustStop,
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        if must_stop() {
            return Err(DenoiseError::Stopped);
        }
        let [width, height] = size;
        let mut output = vec![[0.0; 3]; width * height];
        let mut filter = Filter::new(self, input.kind, size)?;
        input.images.iter().for_each(|(name, image)| filter.read(name, image));
        filter.write(&mut output);
        input.switches.iter().for_each(|name| filter.switch_on(name));
        filter.set_quality(input.quality);
        filter.execute(must_stop);
        // Releasing the filter waits for its work, which reads and writes the images.
        drop(filter);
        self.check()?;
        Ok(output)
    }

    fn check(&self) -> Result<(), DenoiseError> {
        self.error().map_or(Ok(()), Err)
    }

    /// Returns the first error since the last call, if there is one.
    fn error(&self) -> Option<DenoiseError> {
        let mut message = ptr::null();
        // SAFETY: with a null device, the function returns the error of creating a device. The message is
        // valid until the next call.
        let code = unsafe { (self.library.device_error)(self.handle, &raw mut message) };
        match code {
            0 => return None,
            CANCELLED => return Some(DenoiseError::Stopped),
            _ => {}
        }
        if message.is_null() {
            return Some(failed("without a reason"));
        }
        // SAFETY: the message is a C string.
        Some(failed(&unsafe { CStr::from_ptr(message) }.to_string_lossy()))
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: `handle` is a device, and is not used again.
            unsafe { (self.library.release_device)(self.handle) }
        }
    }
}

/// A filter of a device, over images of `size` pixels.
struct Filter<'a> {
    library: &'a Library,
    handle: Handle,
    size: [usize; 2],
}

impl<'a> Filter<'a> {
    fn new(device: &'a Device, kind: Kind, size: [usize; 2]) -> Result<Self, DenoiseError> {
        // SAFETY: `handle` is a device, and the name ends in 0.
        let handle = unsafe { (device.library.new_filter)(device.handle, kind.name().as_ptr()) };
        if handle.is_null() {
            return Err(device.error().unwrap_or_else(|| failed("it lacks a filter")));
        }
        Ok(Self { library: device.library, handle, size })
    }

    /// Sets the input image `name`.
    fn read(&mut self, name: &str, image: &'a [[f32; 3]]) {
        self.check_size(image);
        // The library writes to no image except the output.
        self.set_image(name, image.as_ptr().cast_mut().cast());
    }

    /// Sets the output image.
    fn write(&mut self, image: &'a mut [[f32; 3]]) {
        self.check_size(image);
        self.set_image("output", image.as_mut_ptr().cast());
    }

    fn check_size(&self, image: &[[f32; 3]]) {
        assert_eq!(image.len(), self.size.into_iter().product::<usize>(), "an image has the filter's size");
    }

    fn set_image(&mut self, name: &str, address: *mut c_void) {
        let (name, [width, height]) = (text(name), self.size);
        // SAFETY: the image has that many pixels of three floats, in rows without gaps (strides of 0), and is
        // borrowed as long as the filter.
        unsafe {
            (self.library.set_image)(self.handle, name.as_ptr(), address, FLOAT3, width, height, 0, 0, 0);
        }
    }

    fn switch_on(&mut self, name: &str) {
        let name = text(name);
        // SAFETY: `handle` is a filter.
        unsafe { (self.library.set_filter_bool)(self.handle, name.as_ptr(), true) }
    }

    fn set_quality(&mut self, quality: Quality) {
        // SAFETY: `handle` is a filter, and the name ends in 0.
        unsafe { (self.library.set_filter_int)(self.handle, c"quality".as_ptr(), quality as c_int) }
    }

    fn execute(&mut self, must_stop: MustStop) {
        /// Progress monitor: returns false when the filter must stop. `must_stop` points to a [`MustStop`].
        unsafe extern "C" fn goes_on(must_stop: *mut c_void, _share: f64) -> bool {
            // SAFETY: `execute` outlives the filter's work, and the closure may be called on any thread.
            let must_stop = unsafe { &*must_stop.cast::<MustStop>() };
            !must_stop()
        }
        // SAFETY: `handle` is a filter, its images are valid, and the monitor's data live until the filter
        // has ended.
        unsafe {
            (self.library.set_monitor)(self.handle, goes_on, (&raw const must_stop).cast_mut().cast());
            (self.library.commit_filter)(self.handle);
            (self.library.execute_filter)(self.handle);
        }
    }
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: `handle` is a filter, and is not used again.
        unsafe { (self.library.release_filter)(self.handle) }
    }
}

fn text(name: &str) -> CString {
    CString::new(name).unwrap_or_default()
}

fn failed(reason: &str) -> DenoiseError {
    DenoiseError::Failed { reason: reason.to_owned() }
}
