//! Names of choices.

use photoncard_driver::choice::Choice;
use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::exr::SampleFormat;
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::render::{Radiance, Sampling};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_driver::study::Study;
use photoncard_driver::tone_mapping::ToneCurve;

fn check<T: Choice + PartialEq + std::fmt::Debug>() {
    for (index, &value) in T::ALL.iter().enumerate() {
        assert_eq!(T::of_name(value.name()), Ok(value));
        assert!(!T::ALL[..index].contains(&value), "{value:?} is listed twice");
    }
    let error = T::of_name("Sort ").unwrap_err();
    assert!(T::ALL.iter().all(|value| error.contains(value.name())), "{error}");
}

#[test]
fn every_value_is_found_by_its_name_and_no_other_name_finds_one() {
    check::<Sampling>();
    check::<Radiance>();
    check::<EmulatedKind>();
    check::<SampleFormat>();
    check::<PhotonLayout>();
    check::<ToneCurve>();
    check::<GatherOrder>();
    check::<Study>();
}
