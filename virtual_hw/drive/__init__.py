"""The stand-in's drives: CANopen nodes (CiA 301) that are CiA 402 servo drives."""
