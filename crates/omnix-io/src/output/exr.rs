//! `exr`: depth and confidence of each image as OpenEXR, channels `Z` and `confidence`, f32, without rounding. Where there is no depth, `Z` is
//! infinite, as compositing programs have it.

use std::io::Cursor;
use std::path::PathBuf;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage as _};

use super::atomic;
use super::format::{FileKind, Format};
use super::frame::{FrameResult, RunSummary, Sink};
use crate::IoError;

pub(super) const FORMAT: Format = Format {
    name: "exr",
    files: &[FileKind::of_images(
        "exports/exr/NNNNNN.exr",
        "depth along the camera's axis (channel Z; infinite where a pixel has no depth) and confidence, f32",
    )],
    disk: |size| size.all().saturating_mul(8).saturating_add(size.images.saturating_mul(1000)),
    // The numbers and the file.
    memory: |size| size.pixels.saturating_mul(24),
    frames: Some(|dir, _| Ok(Box::new(ExrSink { dir: dir.to_owned(), written: Vec::new() }))),
    ..Format::NONE
};

struct ExrSink {
    dir: PathBuf,
    written: Vec<PathBuf>,
}

impl Sink for ExrSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        let path = self.dir.join(FORMAT.files[0].numbered(frame.index));
        let depth = |d: &f32| if d.is_finite() && *d > 0.0 { *d } else { f32::INFINITY };
        let depth = frame.depth.iter().map(depth).collect();
        let mut channels = vec![AnyChannel::new("Z", FlatSamples::F32(depth))];
        if let Some(confidence) = frame.confidence {
            channels.push(AnyChannel::new("confidence", FlatSamples::F32(confidence.to_vec())));
        }
        let size = (frame.width as usize, frame.height as usize);
        let image = Image::from_channels(size, AnyChannels::sort(channels.into_iter().collect()));
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).map_err(|e| IoError::write(&path, std::io::Error::other(e)))?;
        self.written.push(atomic::write_file(path, bytes.get_ref())?);
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        Ok(self.written)
    }
}

#[cfg(test)]
mod tests {
    use exr::prelude::{ReadChannels as _, ReadLayers as _, read};

    use super::*;
    use crate::output::export::{Export, open_sinks};
    use crate::output::options::SinkOptions;

    #[test]
    fn numbers_come_back_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let depth = [1.5, f32::MIN_POSITIVE, 1e30, 0.0, f32::NAN, -1.0];
        let confidence = [1.0, 2.0, 3.0, 4.0, 5.0, 6.5];
        let mut sink = open_sinks(&[Export::Exr], dir.path(), &SinkOptions::default()).unwrap().remove(0);
        let frame = FrameResult {
            index: 3,
            video: 0,
            frame: 0,
            time_s: None,
            width: 3,
            height: 2,
            depth: &depth,
            confidence: Some(&confidence),
            rgb: &[0; 18],
            extrinsics: None,
            intrinsics: None,
            sky: None,
            gaussians: None,
            features: &[],
            source: None,
        };
        sink.frame(&frame).unwrap();
        assert_eq!(sink.finish(&RunSummary::default()).unwrap(), [dir.path().join("exports/exr/000003.exr")]);
        let reader =
            read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
        let image = reader.from_file(dir.path().join("exports/exr/000003.exr")).unwrap();
        let channels = &image.layer_data.channel_data.list;
        let values = |k: usize| channels[k].sample_data.values_as_f32().collect::<Vec<_>>();
        assert_eq!(channels.iter().map(|c| c.name.to_string()).collect::<Vec<_>>(), ["Z", "confidence"]);
        assert_eq!(values(0), [1.5, f32::MIN_POSITIVE, 1e30, f32::INFINITY, f32::INFINITY, f32::INFINITY]);
        assert_eq!(values(1), confidence);
    }
}
