//! Links Embree 3.

fn main() {
    println!("cargo::rustc-link-lib=embree3");
    println!("cargo::rerun-if-changed=build.rs");
}
