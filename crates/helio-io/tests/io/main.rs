//! Reading files: what is good is understood, what is bad is refused in good words.

mod angles;
mod files;
mod foreign;
mod good;
mod messages;
mod robust;
mod schema;
