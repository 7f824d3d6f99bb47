//! The numbers of papers (`omnix-eval`) and the losses of training against those of published code: folders of the layout of `golden/eval`.
//! Its README says what each file holds and how close a number must be. One line for each case.

mod depth;
mod files;
mod losses;
mod numbers;
mod pose;
mod tapvid3d;
mod world;

use std::path::Path;

use numbers::Lines;

type Check = fn(&Path) -> Result<Lines, String>;

/// The file that says that a folder has this part, what the part is called, and its check.
const PARTS: [(&str, &str, Check); 8] = [
    ("pose.json", "pose", pose::cases),
    ("pose_tum_fr1_xyz.json", "pose_tum_fr1_xyz", pose::real),
    ("tapvid3d_metrics.json", "tapvid3d_metrics", tapvid3d::cases),
    ("tapvid3d_files/expected.json", "tapvid3d_files", tapvid3d::folders),
    ("world_tracks.json", "world_tracks", world::cases),
    ("depth.json", "depth", depth::cases),
    ("files/association_expected.json", "files", files::cases),
    ("losses.npz", "losses", losses::cases),
];

/// Whether a folder has the layout.
pub(crate) fn is_one(folder: &Path) -> bool {
    PARTS.iter().any(|(file, ..)| folder.join(file).is_file())
}

/// Checks everything in a folder.
pub(crate) fn run(folder: &Path) -> Lines {
    let mut lines = Vec::new();
    for (_, name, check) in PARTS.iter().filter(|(file, ..)| folder.join(file).is_file()) {
        match check(folder) {
            Ok(cases) => lines.extend(cases.into_iter().map(|(case, result)| (format!("{name}/{case}"), result))),
            Err(error) => lines.push(((*name).to_owned(), Err(error))),
        }
    }
    lines
}
