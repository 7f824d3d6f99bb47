//! Exports of motion, the choice of points and saved fields, read back by other code.

mod bad_input;
mod choose;
mod formats;
mod glb;
mod images;
mod lists;
mod made;
mod omx4d;
