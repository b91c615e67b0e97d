"""The fuzzer: mutated payloads against every decoder, judged by a reference of its own."""
