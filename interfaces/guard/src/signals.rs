//! SIGUSR1 before `main`.
//!
//! By default SIGUSR1 kills a process. Schedulers send it at any moment, also to a program that is just being started.
//! The loader runs the functions of `.init_array` as soon as the program is mapped and relocated, which is as early as
//! code of the program can run. A handler takes the place of the ignored signal later.

/// Entry of the list of functions that run before `main`.
#[cfg(all(target_os = "linux", not(miri)))]
#[used]
// SAFETY: the section holds pointers to functions of the C calling convention, and this is one. It may ignore the
// arguments that the loader passes.
#[unsafe(link_section = ".init_array")]
static IGNORE_USR1: extern "C" fn() = {
    extern "C" fn ignore() {
        // SAFETY: `signal` may be called at any time, and ignoring a signal needs no handler.
        unsafe {
            libc::signal(libc::SIGUSR1, libc::SIG_IGN);
        }
    }
    ignore
};

#[cfg(test)]
mod tests {
    #[test]
    #[cfg(all(target_os = "linux", not(miri)))]
    fn usr1_is_ignored_before_main() {
        // SAFETY: the structure is plain data for which zeros are valid, and the call only fills it in.
        let action = unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            let status = libc::sigaction(libc::SIGUSR1, std::ptr::null(), &raw mut action);
            assert_eq!(status, 0);
            action
        };
        assert_eq!(action.sa_sigaction, libc::SIG_IGN);
    }
}
