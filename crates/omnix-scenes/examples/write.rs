//! Writes scenes to a folder and tells the time of each: `cargo run -p omnix-scenes --example write -- OUT [scenes] [seed] [ue|omnix]`.

use std::error::Error;
use std::time::Instant;

use omnix_scenes::{Job, Layout, Recipe};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| arguments.get(k).map_or(Ok(default), |text| text.parse());
    let shared = arguments.get(3).is_some_and(|layout| layout == "omnix");
    let job = Job {
        recipe: Recipe::default(),
        assets: omnix_scenes::Assets::default(),
        seed: number(2, 0)?,
        scenes: number(1, 1)?,
        cameras: 16,
        size: [504, 280],
        labels: omnix_scenes::Labels::default(),
        layout: if shared { Layout::Omnix } else { Layout::Ue },
        shard: [0, 1],
        out: arguments.first().ok_or("the folder to write to is missing")?.into(),
    };
    let mut begin = Instant::now();
    job.run(&|| false, |done| {
        eprintln!("{} {:.1} s, refused {:?}", done.folder.display(), begin.elapsed().as_secs_f64(), done.refused);
        begin = Instant::now();
    })?;
    Ok(())
}
