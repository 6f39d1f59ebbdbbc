//! One file per verb.

pub(crate) mod accuracy;
pub(crate) mod calibrate;
pub(crate) mod check;
pub(crate) mod convert;
pub(crate) mod flux;
pub(crate) mod images;
pub(crate) mod init;
pub(crate) mod observations;
pub(crate) mod predict;
pub(crate) mod schema;
pub(crate) mod simulate;
pub(crate) mod spot;
pub(crate) mod track;
