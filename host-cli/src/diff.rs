//! Command `photoncard diff`.

use photoncard_driver::difference::compare;
use photoncard_driver::exr::read_rgb;

use crate::arguments::DiffOptions;
use crate::console::print_json;
use crate::failure::Failure;

/// Prints the difference between two pictures as JSON.
pub(crate) fn run(options: &DiffOptions) -> Result<(), Failure> {
    let read = |path| read_rgb(path).map_err(|error| Failure::input_error(&error));
    let reference = read(&options.reference)?;
    let image = read(&options.image)?;
    let difference = compare(&reference, &image, options.block, options.exclude_above)
        .map_err(|error| Failure::input_error(&error))?;
    let text = serde_json::to_string_pretty(&difference).map_err(|error| Failure::work_error(&error))?;
    print_json(&text)
}
