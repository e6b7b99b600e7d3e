//! Tests that run the command `photoncard`.

mod autonomy;
mod bad_input;
mod bake;
#[cfg(feature = "study")]
mod commands_of_documents;
mod costly_files;
mod counters;
mod denoise;
mod display;
mod documents;
mod farm;
mod first_minutes;
mod foreign_text;
mod frames;
mod information;
mod interrupt;
mod links;
mod machine_readable;
mod measure;
mod mix;
mod notices;
mod options;
mod package;
mod parts;
mod passes;
mod pictures;
mod prepared;
mod provenance;
mod python;
mod quality;
mod reports;
mod resume;
mod self_test;
#[cfg(feature = "study")]
mod study;
mod support;
mod tone_mapping;
mod verify;
mod view;
mod view_browser;
