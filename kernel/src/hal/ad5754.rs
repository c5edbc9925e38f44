//! AD5754-class quad 16-bit SPI converter as velocity output (placeholder until its helper lands).
