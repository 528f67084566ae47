//! Identity of a list of primitives, which is shared by all that is made of it.

use alloc::sync::Arc;

/// Identity of a list of primitives. Clones of the list and all that is made of it share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Identity(Arc<()>);

impl PartialEq for Identity {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
