from .range_migration import is_lattice, suits_range_migration

__all__ = ["is_lattice", "suits_range_migration"]
