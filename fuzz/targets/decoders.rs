//! What the targets of decoders share.

/// Lets panics of other crates be contained, as they are in the program, and only told: the fuzzer's own hook would end
/// it. Those of our code still do, because nothing catches them.
pub fn tell_panics() {
    std::panic::set_hook(Box::new(|panic| eprintln!("{panic}")));
}
