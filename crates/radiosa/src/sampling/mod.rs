//! Random and low-discrepancy numbers, and maps from the square.
