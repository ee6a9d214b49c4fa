"""Pictures and pages for people: plots by matplotlib, a self-contained HTML page. Imports core, never bpy."""
