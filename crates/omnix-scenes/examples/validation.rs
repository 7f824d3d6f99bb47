//! Writes the validation set in the layout that newer trainers share, a folder for each kind of input, each scene whole or absent:
//!
//! `cargo run --release -p omnix-scenes --example validation -- OUT [images] [width] [height]`
//!
//! 16 images of 252 x 140 pixels unless said otherwise. `omnix data check OUT` measures it. Dense paths have no place in files: a thousand
//! pixels of each sample become tracks. A program that wants all paths asks `omnix_scenes::validation` for its samples.

use std::error::Error;
use std::path::PathBuf;

use omnix_data::sets::shared;
use omnix_scenes::{Input, Random, VALIDATION_SAMPLES, validation};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: usize| arguments.get(k).map_or(Ok(default), |text| text.parse());
    let out = PathBuf::from(arguments.first().ok_or("the folder to write to is missing")?);
    let samples = validation([number(2, 252)?, number(3, 140)?], number(1, 16)?)?;
    for index in 0..VALIDATION_SAMPLES {
        let kind = out.join(Input::in_turn(index).name());
        let (folder, part) = (kind.join(format!("{index:02}")), kind.join(format!(".{index:02}.part")));
        if folder.exists() {
            continue;
        }
        let sample = samples.get(index)?;
        let mut random = Random::new(index, 0, "tracks");
        let points: Vec<(usize, usize)> =
            (0..1000).map(|_| (random.below(sample.count()), random.below(sample.pixels()))).collect();
        if part.exists() {
            std::fs::remove_dir_all(&part)?;
        }
        shared::write(&sample, &part, &points)?;
        std::fs::rename(&part, &folder)?;
        eprintln!("{}", folder.display());
    }
    Ok(())
}
