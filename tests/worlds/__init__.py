"""Independent worlds: simulators that make campaigns with a hidden cause in them.

They share nothing with the package's forward model: `picchio.campaign` alone is imported, to write
what was measured. The physics, the integrator and the sensors here are the world's own. To use the
package from elsewhere, put `tests/` on `sys.path` and `import worlds.campaign`.
"""
