//! From command-line inputs to a plan of frames.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::{
    choice::FrameChoice,
    header,
    options::ReadOptions,
    plan::{InputPlan, PlannedFrame, Source, SourceKind},
    sources,
};
use crate::IoError;

/// [`probe_with`] for a choice of frames, with every other option as it is by default.
///
/// # Errors
/// As [`probe_with`].
pub fn probe<P: AsRef<Path>>(inputs: &[P], choice: FrameChoice) -> Result<InputPlan, IoError> {
    probe_with(inputs, &ReadOptions::new(choice))
}

/// Lists the frames of all inputs: of pictures the headers are read, videos are decoded once without keeping a picture.
///
/// The choice applies to each video by itself. Pictures carry no times: a rate, a start and an end leave all of them, and a note
/// says so.
///
/// # Errors
/// An input that does not exist, has no frames, is of an unknown type or not what its name says; a video that cannot be decoded
/// at all, or is damaged where the options are strict; ffmpeg or ffprobe missing or hung when an input is a video; a choice of no
/// frames; a stop that was asked for.
pub fn probe_with<P: AsRef<Path>>(inputs: &[P], options: &ReadOptions) -> Result<InputPlan, IoError> {
    let choice = options.choice;
    choice.check()?;
    let mut plan = InputPlan { sources: Vec::new(), frames: Vec::new(), notes: Vec::new() };
    for input in inputs {
        sources::resolve(input.as_ref(), options, &mut plan.sources, &mut plan.notes)?;
    }
    let mut frames = Vec::new();
    for source in &plan.sources {
        let chosen = chosen(source, choice);
        if let (SourceKind::Video(info), true) = (&source.kind, chosen.is_empty()) {
            let span = info.times_s.last().zip(info.times_s.first()).map_or(0.0, |(last, first)| last - first);
            let reason = format!("no frame of {} in that part, which lasts {span:.2} seconds", source.path.display());
            return Err(IoError::BadChoice { reason });
        }
        frames.extend(chosen);
    }
    plan.notes.extend(remarks(&plan.sources, &frames, choice));
    // Thousands of small reads: in parallel they take well under a second even on a cold cache.
    frames.par_iter_mut().enumerate().try_for_each(|(index, frame)| {
        frame.index = index;
        if frame.width == 0 {
            let header = header::header(&frame.path)?;
            (frame.width, frame.height) = header.upright();
            frame.bytes = header.bytes;
        }
        Ok::<(), IoError>(())
    })?;
    if frames.is_empty() {
        let path = inputs.first().map_or_else(PathBuf::new, |input| input.as_ref().to_owned());
        return Err(IoError::NoFrames { found: "no inputs".into(), path });
    }
    plan.frames = frames;
    Ok(plan)
}

/// The chosen frames of one video, pictures without their size.
fn chosen(source: &Source, choice: FrameChoice) -> Vec<PlannedFrame> {
    let frame = |(frame, number): (usize, usize)| PlannedFrame {
        index: 0,
        video: source.video,
        frame: frame as u32,
        source_frame: number as u32,
        time_s: None,
        path: source.path.clone(),
        width: 0,
        height: 0,
        bytes: 0,
    };
    match &source.kind {
        SourceKind::Images(files) => {
            let picked = choice.pick(files.len(), None).into_iter().enumerate();
            picked.map(|p| PlannedFrame { path: files[p.1].clone(), ..frame(p) }).collect()
        }
        SourceKind::Video(info) => {
            let picked = choice.pick(info.times_s.len(), Some(&info.times_s)).into_iter().enumerate();
            let (width, height) = (info.width, info.height);
            // One is handed out while the next is read.
            let bytes = 6 * u64::from(width) * u64::from(height);
            picked.map(|p| PlannedFrame { time_s: Some(info.times_s[p.1]), width, height, bytes, ..frame(p) }).collect()
        }
    }
}

/// What a user may not expect of a choice and of the inputs' kinds.
fn remarks(sources: &[Source], frames: &[PlannedFrame], choice: FrameChoice) -> Vec<String> {
    let mut notes = Vec::new();
    let pictures = |s: &&Source| matches!(&s.kind, SourceKind::Images(files) if files.len() > 1);
    let untimed = sources.iter().filter(pictures).count();
    if choice.needs_times() && untimed > 0 {
        notes.push(format!(
            "pictures carry no times, so frame rate, start and end were not applied to {untimed} folder(s) or pattern(s) of them"
        ));
    }
    if let Some(wanted) = choice.wanted() {
        for source in sources {
            let found = frames.iter().filter(|f| f.video == source.video).count();
            // A single picture has one frame and nobody expects more.
            let single = matches!(&source.kind, SourceKind::Images(files) if files.len() <= 1);
            if found < wanted && !single {
                notes.push(format!("{}: {wanted} frames were asked for and {found} are there", source.path.display()));
            }
        }
    }
    let single = |s: &&Source| matches!(&s.kind, SourceKind::Images(files) if files.len() == 1 && files[0] == s.input);
    let singles = sources.iter().filter(single).count();
    if singles > 1 {
        notes.push(format!(
            "{singles} pictures were named one by one: each is a video of its own, seen at a time of its own; name their folder \
             or a pattern in quotation marks to make them one video"
        ));
    }
    notes
}
