//! `omnix weights convert`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use omnix::checkpoint::{Checkpoint, Conversion, Float, WeightsError};
use omnix::{OmnixError, Weights};
use serde_json::json;

use crate::error::CliError;
use crate::ui::Ui;
use crate::{bytes, disk, stop};

/// Arguments of `convert`.
#[derive(Debug, Args)]
pub(crate) struct ConvertArgs {
    /// A folder or file that `weights info` can open, or `nano`.
    #[arg(value_name = "PATH|NAME")]
    weights: String,
    /// Folder to write config.json and model.safetensors to; made if it is not there.
    #[arg(value_name = "DIR")]
    out: PathBuf,
    /// Type of all floating-point numbers. [default: as they are]
    #[arg(long = "type", value_name = "TYPE")]
    dtype: Option<Type>,
    /// Bytes of a file at most, such as 2GB: more tensors go to further files, with an index. [default: one file]
    #[arg(long, value_name = "SIZE", value_parser = bytes::parse)]
    shard: Option<u64>,
    /// One JSON object a line on standard output: progress {phase, done, total, seconds}, converted {files, bytes, left_out}, error.
    #[arg(long)]
    pub(super) json: bool,
}

/// Types that numbers are stored as. (A file cannot have int8: products round to it while weights are loaded, see `--weights-type`.)
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Type {
    /// 4 bytes, everything.
    F32,
    /// 2 bytes, 11 bits of precision, up to 65504.
    F16,
    /// 2 bytes, 8 bits of precision, as far as f32 reaches.
    Bf16,
}

/// Writes a checkpoint anew.
pub(super) fn run(args: &ConvertArgs, ui: &mut Ui) -> Result<(), CliError> {
    // A network that cannot be run here can be converted all the same.
    let found = Weights::find(&args.weights);
    let opened;
    let checkpoint = match &found {
        Ok(weights) => weights.checkpoint(),
        Err(OmnixError::Model(_) | OmnixError::Weights(WeightsError::Mismatch { .. })) => {
            opened = Checkpoint::open(Path::new(&args.weights)).map_err(OmnixError::from)?;
            &opened
        }
        Err(_) => return found.map(drop).map_err(CliError::from),
    };
    let dtype = args.dtype.map(|dtype| match dtype {
        Type::F32 => Float::F32,
        Type::F16 => Float::F16,
        Type::Bf16 => Float::BF16,
    });
    let conversion = Conversion { dtype, shard: args.shard };
    std::fs::create_dir_all(&args.out).map_err(|source| CliError::File { path: args.out.clone(), source })?;
    disk::check(&args.out, conversion.plan(checkpoint).iter().map(|(_, bytes)| bytes).sum())?;
    ui.begin("convert", &format!("converting {}", checkpoint.name()));
    let mut progress = |done, total| {
        ui.progress(done, total);
        stop::flow()
    };
    let done = conversion.write(checkpoint, &args.out, &mut progress).map_err(OmnixError::from)?;
    ui.end();
    ui.event(
        "converted",
        json!({ "files": done.files, "bytes": done.bytes, "left_out": done.left_out, "dir": args.out }),
    );
    let beside = match done.left_out.len() {
        0 => String::new(),
        n => format!("; {n} tensor(s) that are not the network's were left out"),
    };
    ui.say(&format!(
        "{} in {} file(s) and config.json in {}{beside}",
        bytes::show(done.bytes),
        done.files.len(),
        args.out.display()
    ));
    Ok(())
}
