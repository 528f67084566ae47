//! Open connections of the server, and who gives way when there are too many.

use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Most connections at a time.
const CONNECTIONS: usize = 64;

/// The open connections.
#[derive(Debug, Default)]
pub(crate) struct Guests(Mutex<List>);

#[derive(Debug, Default)]
struct List {
    /// Connections in the order in which they came.
    open: Vec<Entry>,
    next_id: u64,
}

#[derive(Debug)]
struct Entry {
    id: u64,
    stream: Arc<TcpStream>,
    /// Whether the connection has named the secret.
    is_admitted: bool,
}

/// Place of one connection, which is free again when this is dropped.
#[derive(Debug)]
pub(crate) struct Guest {
    id: u64,
    guests: Arc<Guests>,
}

impl Guests {
    /// Gives a connection a place. If all are taken, the stranger who came first is cut off. `None` if there is no
    /// stranger.
    pub fn enter(guests: &Arc<Self>, stream: &Arc<TcpStream>) -> Option<Guest> {
        let mut list = guests.lock();
        if list.open.len() >= CONNECTIONS {
            let oldest = list.open.iter().position(|entry| !entry.is_admitted)?;
            let stranger = list.open.remove(oldest);
            // Its thread wakes up, and ends. A connection that is closed already cannot be shut down, and need not be.
            let _ = stranger.stream.shutdown(Shutdown::Both);
        }
        let id = list.next_id;
        list.next_id += 1;
        list.open.push(Entry {
            id,
            stream: Arc::clone(stream),
            is_admitted: false,
        });
        Some(Guest {
            id,
            guests: Arc::clone(guests),
        })
    }

    fn lock(&self) -> MutexGuard<'_, List> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Guest {
    /// Notes that the connection has named the secret.
    pub fn admit(&self) {
        let mut list = self.guests.lock();
        if let Some(entry) = list.open.iter_mut().find(|entry| entry.id == self.id) {
            entry.is_admitted = true;
        }
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        self.guests.lock().open.retain(|entry| entry.id != self.id);
    }
}
