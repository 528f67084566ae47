//! Errors of viewers.

use std::io;

/// Why there is nothing to look at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The page cannot be served at a port of this machine.
    #[error("cannot serve a page at port {port} of 127.0.0.1: {source}")]
    Listen {
        /// The requested port; 0 is any free one.
        port: u16,
        /// Reason of the system.
        source: io::Error,
    },
    /// The system gives no random numbers for the secret in the address.
    #[error("cannot make a secret address: {0}")]
    Secret(String),
    /// A thread cannot be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[source] io::Error),
    /// The rendering failed.
    #[error(transparent)]
    Render(antumbra_render::Error),
    /// The picture cannot be written.
    #[error(transparent)]
    Image(antumbra_image::Error),
}
