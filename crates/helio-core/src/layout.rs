//! Generated fields.
