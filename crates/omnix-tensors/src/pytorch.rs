//! Checkpoints of PyTorch (`torch.save` since 1.6: `.pt`, `.pth`, `.ckpt`, `.bin`), read without Python.
//!
//! A zip archive whose entries are stored as they are: a pickle (`data.pkl`) that says what the tensors are, and the numbers of each storage in
//! an entry of its own (`data/0`, ..), which are used in place. The pickle is read and not run (`pickle.rs`). Views that do not lie in
//! order are put in order in memory; all together take no more than the file has.
//!
//! Source: `torch/serialization.py` and `torch/_utils.py` of PyTorch 2; `spec/omnix.md` 1.2.

mod archive;
mod layout;
mod state;

use std::path::Path;

use crate::{TensorError, pickle};
use archive::{Archive, Flaw};
pub(crate) use layout::Checkpoint;

/// Bytes of the file for each value that its pickle may make; a value takes 16 bytes, and a tensor about 40 values.
const BYTES_A_VALUE: usize = 16;
/// Values that a pickle may make however short the file is: those of some ten thousand tensors.
const LEAST_ROOM: usize = 1 << 19;

/// Whether these are the first bytes of a zip archive.
pub(crate) fn is_archive(start: &[u8]) -> bool {
    start.starts_with(b"PK\x03\x04")
}

/// Reads the directory and the pickle of a file.
pub(crate) fn read(bytes: &[u8], path: &Path) -> Result<Checkpoint, TensorError> {
    parse(bytes).map_err(|reason| TensorError::PyTorch { path: path.to_owned(), reason })
}

fn parse(bytes: &[u8]) -> Result<Checkpoint, Flaw> {
    let archive = Archive::read(bytes)?;
    let top = top_folder(&archive)?;
    if archive.has(&format!("{top}constants.pkl"))
        || archive.names().any(|name| name.starts_with(format!("{top}code/").as_bytes()))
    {
        return Err("it is a TorchScript program; save the state_dict of its module in Python".to_owned());
    }
    match archive.get(&format!("{top}byteorder")) {
        Ok(b"little") => {}
        Ok(_) => return Err("it was saved on a big-endian machine; load and save it again on another".to_owned()),
        // Files of before 2.0 have no mark.
        Err(_) => {}
    }
    let room = (bytes.len() / BYTES_A_VALUE).saturating_add(LEAST_ROOM);
    let pickle = pickle::read(archive.get(&format!("{top}data.pkl"))?, room)
        .map_err(|flaw| format!("its data.pkl has at byte {} {}", flaw.at, flaw.reason))?;
    let state = state::find(&pickle)?;
    layout::place(&archive, &top, &pickle, state)
}

/// The folder that all entries lie in, with its slash: the archive's name when it was saved, whatever it is called now.
fn top_folder(archive: &Archive<'_>) -> Result<String, Flaw> {
    let pickles: Vec<&[u8]> = archive
        .names()
        .filter_map(|name| name.strip_suffix(b"data.pkl"))
        .filter(|top| top.is_empty() || (top.ends_with(b"/") && top.iter().filter(|&&b| b == b'/').count() == 1))
        .collect();
    match *pickles {
        [top] => String::from_utf8(top.to_vec()).map_err(|_| "the name of its folder is no text".to_owned()),
        [] => Err("it is a zip archive without data.pkl, which torch.save writes".to_owned()),
        _ => Err("it has more than one data.pkl".to_owned()),
    }
}

#[cfg(test)]
mod tests;
