//! Where pictures go: a film, one file, or a folder.

use std::path::{Path, PathBuf};

use omnix::OmnixError;
use omnix::io::output::{Film, check_output_folder, write_png};
use omnix::render::Rendered;

use crate::disk;
use crate::error::CliError;

/// What is to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    Film,
    Picture,
    Folder,
}

impl Target {
    /// By the name's ending.
    pub(super) fn of(path: &Path) -> Self {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("mp4") => Self::Film,
            Some("png") => Self::Picture,
            _ => Self::Folder,
        }
    }

    /// What can be known before any work.
    pub(super) fn check(self, background: bool) -> Result<(), CliError> {
        if self == Self::Film && !background {
            return Err(CliError::Usage(
                "a film has a background: --background none is for .png and folders".to_owned(),
            ));
        }
        Ok(())
    }

    /// Makes the folder, and sees that there is an encoder and room on the disk.
    pub(super) fn make(self, path: &Path, pictures: usize, [width, height]: [u32; 2]) -> Result<(), CliError> {
        let folder = if self == Self::Folder { path } else { folder_of(path) };
        check_output_folder(folder)?;
        if self == Self::Film {
            Film::check(path)?;
        }
        // Half a byte a pixel of a film, three of a picture, are rather too many.
        let pixels = u64::from(width) * u64::from(height) * pictures as u64;
        disk::check(folder, if self == Self::Film { pixels / 2 } else { 3 * pixels })
    }
}

/// The folder that a path of a file is in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The files in the making.
pub(super) struct Output {
    target: Target,
    path: PathBuf,
    film: Option<Film>,
    written: usize,
    transparent: bool,
}

impl Output {
    pub(super) fn begin(
        target: Target,
        path: &Path,
        size: [u32; 2],
        rate: f64,
        transparent: bool,
    ) -> Result<Self, CliError> {
        let film = if target == Target::Film { Some(Film::begin(path, size, rate)?) } else { None };
        Ok(Self { target, path: path.to_owned(), film, written: 0, transparent })
    }

    pub(super) fn picture(&mut self, picture: &Rendered) -> Result<(), CliError> {
        if let Some(film) = &mut self.film {
            film.picture(&picture.rgb8())?;
        } else {
            let path = match self.target {
                Target::Folder => self.path.join(format!("{:06}.png", self.written)),
                Target::Picture | Target::Film => self.path.clone(),
            };
            let pixels = if self.transparent { picture.rgba8() } else { picture.rgb8() };
            write_png(path, &pixels, picture.size, self.transparent)?;
        }
        self.written += 1;
        Ok(())
    }

    pub(super) fn finish(&mut self) -> Result<(), CliError> {
        if let Some(film) = self.film.take() {
            film.finish()?;
        }
        Ok(())
    }

    /// What a signal leaves: the pictures of a folder, nothing of a film.
    pub(super) fn interrupted(&mut self, finished: usize, pictures: usize, dir: &Path) -> CliError {
        self.film = None;
        match self.target {
            Target::Folder => CliError::RenderInterrupted { finished, pictures, dir: dir.to_owned() },
            Target::Film | Target::Picture => OmnixError::Interrupted.into(),
        }
    }
}
