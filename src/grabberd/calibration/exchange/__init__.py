"""The documented path of networks that other programs have measured."""
