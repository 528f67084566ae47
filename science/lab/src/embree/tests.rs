use super::*;

#[test]
fn what_is_not_embree_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = folder.path().join("none.so");
    let text = folder.path().join("text.so");
    std::fs::write(&text, "not a library").expect("a file");
    for (path, hint) in [(missing, "no such file"), (text, "text.so")] {
        let reason = Embree::load(&path).err().expect("no Embree").to_string();
        assert!(
            reason.contains(hint) && reason.contains("as Embree"),
            "{reason}"
        );
    }
}
