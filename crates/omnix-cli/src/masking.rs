//! Masks of a run: read, brought to the network's size as the pictures are, and said in words.

use omnix::io::cameras::MatchedCamera;
use omnix::io::input::SourceKind;
use omnix::io::masks::{Mask, MatchedMasks, match_masks};
use omnix::io::output::manifest::path_text;
use omnix::io::{InputPlan, IoError, PlannedFrame};
use omnix::{Masks, OmnixError, PixelMark, Weights};
use serde_json::{Map, Value, json};

use crate::args::RunArgs;
use crate::error::CliError;
use crate::mask_folder::Says;
use crate::prepare::Preparation;
use crate::stop;

/// The masks of a run, and what a user should see of them.
pub(crate) struct Masking {
    pub(crate) masks: Masks,
    pub(crate) notes: Vec<String>,
}

/// Reads all masks that are asked for; `None` for a run without masks.
///
/// # Errors
/// Folders, sizes and pictures that do not fit; masks of motion for a network without; a pixel that is to stand still and to move.
pub(crate) fn read(
    args: &RunArgs,
    weights: &Weights,
    input: &InputPlan,
    preparation: &Preparation,
    known: Option<&[MatchedCamera]>,
) -> Result<Option<Masking>, CliError> {
    if args.masks.is_empty() && !args.alpha_masks {
        return Ok(None);
    }
    let config = weights.network().config();
    if let Some(folder) = args.masks.iter().find(|folder| folder.says != Says::Ignore && config.trajectory.is_none()) {
        return Err(CliError::Usage(format!(
            "--masks {folder} says what moves, and {} has no trajectories: take an OmniX network, or leave these masks out",
            config.name
        )));
    }
    let mut notes = Vec::new();
    let mut folders: Vec<(Says, MatchedMasks)> = Vec::new();
    for folder in &args.masks {
        let mut found = match_masks(&folder.path, input)?;
        notes.append(&mut found.notes);
        folders.push((folder.says, found));
    }
    let (mut masks, mut without_alpha) = (Masks::new(), 0usize);
    for (index, frame) in input.frames.iter().enumerate() {
        if stop::asked() {
            return Err(OmnixError::Interrupted.into());
        }
        let mut read: Vec<(Says, Mask)> = Vec::new();
        for (says, found) in &folders {
            if let Some(file) = &found.files[index] {
                read.push((*says, Mask::read(file)?));
            }
        }
        if args.alpha_masks {
            let alpha = if is_video(input, frame) { None } else { Mask::of_alpha(&frame.path)? };
            without_alpha += usize::from(alpha.is_none());
            read.extend(alpha.map(|mask| (Says::Ignore, mask)));
        }
        masks.push(marks(&read, frame, preparation, known.map(|known| &known[index]))?);
    }
    let all = input.frames.len();
    if without_alpha == all {
        return Err(CliError::Usage(
            "--alpha-masks is for pictures with an alpha channel, and none of these has one".to_owned(),
        ));
    }
    if without_alpha > 0 {
        notes.push(format!(
            "{without_alpha} of {all} image(s) have no alpha channel: nothing of them is left out by it"
        ));
    }
    let (width, height) = preparation.size();
    let pixels = all as f64 * f64::from(width) * f64::from(height);
    let share = |mark| 100.0 * masks.count(mark) as f64 / pixels;
    notes.push(format!(
        "masks leave out {:.1} % of all pixels, hold {:.1} % still and let {:.1} % move",
        share(PixelMark::Ignored),
        share(PixelMark::Still),
        share(PixelMark::Moving)
    ));
    Ok(Some(Masking { masks, notes }))
}

fn is_video(input: &InputPlan, frame: &PlannedFrame) -> bool {
    input.sources.iter().any(|s| s.video == frame.video && matches!(s.kind, SourceKind::Video(_)))
}

/// What the masks of a frame say of every pixel that the network sees: each is looked up at the pixel's middle.
fn marks(
    read: &[(Says, Mask)],
    frame: &PlannedFrame,
    preparation: &Preparation,
    known: Option<&MatchedCamera>,
) -> Result<Vec<PixelMark>, CliError> {
    let (width, height) = preparation.size();
    if read.is_empty() {
        return Ok(vec![PixelMark::None; width as usize * height as usize]);
    }
    let framing = preparation.framing(frame);
    let size = [frame.width, frame.height];
    let bent = known.map(|known| known.lens).filter(|lens| !lens.distortion.is_none());
    let mut marks = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let [left, top, ..] = framing.crop;
            let mut place = [
                (f64::from(x + left) + 0.5) / f64::from(framing.resized.0),
                (f64::from(y + top) + 0.5) / f64::from(framing.resized.1),
            ];
            if let Some(lens) = bent {
                let seen = lens.seen_at([0, 1].map(|axis| place[axis] * f64::from(size[axis])), size);
                place = [0, 1].map(|axis| seen[axis] / f64::from(size[axis]));
            }
            // What an undistorted picture has beyond the picture itself was never seen.
            let inside = place.iter().all(|p| (0.0..=1.0).contains(p));
            let says = |what: Says| read.iter().any(|(says, mask)| *says == what && inside && mask.at(place));
            let ignored = read.iter().any(|(says, mask)| *says == Says::Ignore && !(inside && mask.at(place)));
            marks.push(match (ignored, says(Says::Still), says(Says::Moving)) {
                (true, _, _) => PixelMark::Ignored,
                (false, true, true) => {
                    return Err(IoError::BadMasks {
                        reason: "a pixel of this picture is to stand still by one and to move by another".to_owned(),
                        path: frame.path.clone(),
                    }
                    .into());
                }
                (false, true, false) => PixelMark::Still,
                (false, false, true) => PixelMark::Moving,
                (false, false, false) => PixelMark::None,
            });
        }
    }
    Ok(marks)
}

/// For the manifest; null for a run without masks.
pub(crate) fn described(args: &RunArgs, masks: Option<&Masks>) -> Value {
    let Some(masks) = masks else { return Value::Null };
    let mut fields = Map::new();
    for folder in &args.masks {
        let list = fields.entry(folder.says.name()).or_insert_with(|| json!([]));
        list.as_array_mut().into_iter().for_each(|list| list.push(path_text(&folder.path).into()));
    }
    fields.insert("alpha".to_owned(), args.alpha_masks.into());
    fields.insert("digest".to_owned(), masks.digest().into());
    let marks = [("ignored", PixelMark::Ignored), ("still", PixelMark::Still), ("moving", PixelMark::Moving)];
    let pixels: Map<String, Value> =
        marks.map(|(name, mark)| (name.to_owned(), masks.count(mark).into())).into_iter().collect();
    fields.insert("pixels".to_owned(), pixels.into());
    Value::Object(fields)
}
