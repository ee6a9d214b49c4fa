"""The words of the interface in German, by Blender's own mechanism."""

import bpy

CONTEXTS = ("*", "Operator")
GERMAN = {
    # Panels and buttons
    "Capture": "Aufnahme",
    "Photographs": "Fotos",
    "Shape": "Form",
    "Reflectance": "Reflexion",
    "Relight": "Neu beleuchten",
    "Inverse Rendering": "Inverses Rendern",
    "Compare": "Vergleichen",
    "Comparison": "Vergleich",
    "Settings": "Einstellungen",
    "Add Light Rig": "Lichtgerüst hinzufügen",
    "Continue the Stopped Capture": "Angehaltene Aufnahme fortsetzen",
    "Import Photographs": "Fotos importieren",
    "Recover Shape": "Form gewinnen",
    "Why This Depth": "Warum diese Tiefe",
    "Recover Reflectance": "Reflexion gewinnen",
    "Make Material": "Material erzeugen",
    "Relight Live": "Fortlaufend neu beleuchten",
    "Keep in a Small File": "In kleiner Datei aufheben",
    "Recover from Photograph": "Aus dem Foto gewinnen",
    "Compare with the Capture": "Mit der Aufnahme vergleichen",
    "Estimate Time and Error": "Zeit und Fehler schätzen",
    "Use Preset": "Voreinstellung benutzen",
    "Plan Effects": "Effekte planen",
    "Effects of Light": "Effekte des Lichts",
    "Cast shadows": "Schlagschatten",
    "Near-light fall-off": "Abfall naher Lichter",
    "Diffuse interreflection": "Diffuses Licht zwischen Flächen",
    "Glossy interreflection": "Spiegelndes Licht zwischen Flächen",
    "Caustics": "Kaustiken",
    "Transmission": "Durchlässigkeit",
    "Volumes": "Volumen",
    "Subsurface": "Streuung unter der Oberfläche",
    "Emission": "Leuchten",
    "Depth of field": "Schärfentiefe",
    "Motion blur": "Bewegungsunschärfe",
    "Sensor noise": "Sensorrauschen",
    "Saturation": "Übersteuerung",
    "{} % of the time": "{} % der Zeit",
    "Draft": "Entwurf",
    "Standard": "Standard",
    "Final": "Endfassung",
    "Last time": "Zuletzt",
    "Show in Image Editor": "Im Bildeditor zeigen",
    "Show Bases on Balls": "Basen auf Kugeln zeigen",
    "List Groups": "Gruppen auflisten",
    "Group Selected": "Auswahl gruppieren",
    "Apply Recovered Material": "Gewonnenes Material anwenden",
    "Apply All": "Alle anwenden",
    "Revert All": "Alle zurücknehmen",
    "Import Photographs to Recover From": "Fotos zum Gewinnen importieren",
    "Photographs to Recover From": "Fotos zum Gewinnen",
    "Open Capture": "Aufnahme öffnen",
    "Use Scanned Mesh": "Gescanntes Mesh benutzen",
    "Lightsphere Capture": "Lightsphere-Aufnahme",
    "Delete Compiled Solvers": "Übersetzte Löser löschen",
    "Copy Report": "Bericht kopieren",
    "Compiled solvers": "Übersetzte Löser",
    "Results": "Ergebnisse",
    # What they do
    "Add the lights of the settings as an object that you can move and scale; the capture then uses it": (
        "Fügt die Lichter der Einstellungen als ein Objekt hinzu, das man bewegen und skalieren kann; die Aufnahme "
        "benutzt es dann"
    ),
    "Render one picture per light of the rig with Cycles, on a saved copy of this file. Esc stops": (
        "Rendert mit Cycles ein Bild je Licht des Gerüsts, auf einer gespeicherten Kopie der Datei. Esc hält an"
    ),
    "Try which effects of light the pictures need, what each adds and takes; the capture does so, too. Esc stops": (
        "Probiert, welche Effekte des Lichts die Bilder brauchen, was jeder beiträgt und kostet; die Aufnahme tut das "
        "auch. Esc hält an"
    ),
    "Whether the capture simulates this effect; what you decide is done, whatever it adds": (
        "Ob die Aufnahme diesen Effekt simuliert; was man entscheidet, gilt, was immer es beiträgt"
    ),
    "Make a capture from photographs of an object under one light at a time. Esc stops": (
        "Macht eine Aufnahme aus Fotos eines Objekts unter je einem Licht. Esc hält an"
    ),
    "Recover depth, normals and a mesh from the capture. Esc stops": (
        "Gewinnt Tiefe, Normalen und ein Mesh aus der Aufnahme. Esc hält an"
    ),
    "Click on the recovered mesh: a plot shows what the pictures say about the depth there, and how sure it is": (
        "Auf das gewonnene Mesh klicken: eine Kurve zeigt, was die Bilder über die Tiefe dort sagen und wie sicher sie "
        "ist"
    ),
    "Find the materials that the recovered surface is mixed of, whatever they are, and where each is. Esc stops": (
        "Findet die Materialien, aus denen die gewonnene Fläche gemischt ist, und wo jedes ist. Esc hält an"
    ),
    "Make a node material of what was recovered and add the asset to the scene. Esc stops": (
        "Macht ein Node-Material aus dem Gewonnenen und fügt das Asset der Szene hinzu. Esc hält an"
    ),
    "Keep capture and shape in one small file to relight from anywhere, and a map for RTI viewers. Esc stops": (
        "Hebt Aufnahme und Form in einer kleinen Datei auf, die überall neu beleuchtet werden kann, und als Karte für "
        "RTI-Betrachter. Esc hält an"
    ),
    "Make the captured picture under the lights of this scene, without tracing a ray. Esc stops": (
        "Macht das aufgenommene Bild unter den Lichtern dieser Szene, ohne einen Strahl zu verfolgen. Esc hält an"
    ),
    "Recover what every group of surfaces of this scene reflects from one photograph of it. Esc stops": (
        "Gewinnt aus einem Foto der Szene, was jede Gruppe ihrer Flächen reflektiert. Esc hält an"
    ),
    "Render the asset as it is now under captured and new lights, and show where they differ. Esc stops": (
        "Rendert das Asset, wie es jetzt ist, unter aufgenommenen und neuen Lichtern und zeigt die Unterschiede. "
        "Esc hält an"
    ),
    "Try the stage on a part of its input: what Draft, Standard and Final would take and give. Esc stops": (
        "Probiert die Stufe an einem Teil: was Entwurf, Standard und Endfassung kosten und bringen. Esc hält an"
    ),
    "Use these settings: the quickest that are expected to have an error as small as is said": (
        "Benutzt diese Einstellungen: die schnellsten, deren Fehler voraussichtlich so klein ist wie angegeben"
    ),
    "Keep the relit picture up to date while you move the lights of this scene; press again to end it": (
        "Hält das neu beleuchtete Bild aktuell, während Lichter bewegt werden; nochmals drücken beendet es"
    ),
    "Add a ball of each basis of the asset's material beside it, lit as the scene is": (
        "Fügt neben dem Asset eine Kugel je Basis seines Materials hinzu, im Licht der Szene"
    ),
    "Show the comparison in the Image Editors that are open": "Zeigt den Vergleich in den offenen Bildeditoren",
    "List which surfaces share a reflectance": "Listet auf, welche Flächen eine Reflexion teilen",
    "Let the selected objects share one reflectance": "Lässt die ausgewählten Objekte eine Reflexion teilen",
    "Give the surfaces of a group the material that was recovered, or the one back that they had": (
        "Gibt den Flächen einer Gruppe das gewonnene Material oder das zurück, das sie hatten"
    ),
    "Import the photographs of a folder: one light at a time, with a list of lights, a mirror ball or neither": (
        "Importiert die Fotos eines Ordners: je ein Licht, mit einer Liste der Lichter, einer Spiegelkugel oder keinem"
    ),
    "Open a capture that was made before: choose the capture.json in its folder": (
        "Öffnet eine frühere Aufnahme: die capture.json in ihrem Ordner wählen"
    ),
    "Take the shape from a scanned mesh of the captured object: it keeps its triangles, the material is recovered": (
        "Nimmt die Form von einem gescannten Mesh des Objekts: seine Dreiecke bleiben, das Material wird gewonnen"
    ),
    "Delete the compiled solvers; the next shape compiles them anew, which takes a minute or two": (
        "Löscht die übersetzten Löser; die nächste Form übersetzt sie neu, was ein, zwei Minuten dauert"
    ),
    "Copy what a bug report needs to the clipboard: versions, system, the last command and what it said": (
        "Kopiert, was ein Fehlerbericht braucht: Versionen, System, den letzten Befehl und was er sagte"
    ),
    # Why a button is grey
    "The scene has no camera": "Die Szene hat keine Kamera",
    "The scene has no mesh to capture": "Die Szene hat kein Mesh zum Aufnehmen",
    "The scene has no rig: add one": "Die Szene hat kein Lichtgerüst: eines hinzufügen",
    "The surfaces intersect: enlarge the outer one": "Die Flächen schneiden sich: die äußere vergrößern",
    "The scene has no light: add one": "Die Szene hat kein Licht: eines hinzufügen",
    "The scene has no asset: make one": "Die Szene hat kein Asset: eines erzeugen",
    "No capture is chosen yet": "Noch keine Aufnahme gewählt",
    "No finished capture is there": "Dort ist keine fertige Aufnahme",
    "No shape is chosen yet": "Noch keine Form gewählt",
    "No recovered shape is there": "Dort ist keine gewonnene Form",
    "No photographs are chosen yet": "Noch keine Fotos gewählt",
    "No photographs are there": "Dort sind keine Fotos",
    "No photograph is chosen yet": "Noch kein Foto gewählt",
    "No photograph is there": "Dort ist kein Foto",
    "No object is selected": "Kein Objekt ist ausgewählt",
    # What a scene remembers
    "Scan": "Scan",
    "Scan Unit": "Einheit des Scans",
    "Photograph": "Foto",
    "Group": "Gruppe",
    "Pixel": "Pixel",
    "Layer": "Schicht",
    "Show": "Zeigen",
    "Plain": "Schlicht",
    "Confidence": "Sicherheit",
    "Expected Error": "Erwarteter Fehler",
    "Depth": "Tiefe",
    "Normals": "Normalen",
    "View": "Ansicht",
    "Split": "Geteilt",
    "Side by Side": "Nebeneinander",
    "Difference": "Unterschied",
    "Pictures": "Bilder",
    "Light": "Licht",
    # Settings
    "Rig": "Lichtgerüst",
    "Inner": "Innen",
    "Outer": "Außen",
    "Radius Inner": "Radius innen",
    "Radius Outer": "Radius außen",
    "Power": "Stärke",
    "Resolution": "Auflösung",
    "Effects": "Effekte",
    "Error": "Fehler",
    "Simulate": "Simulieren",
    "Leave Out": "Weglassen",
    "Renderer": "Renderer",
    "Samples": "Samples",
    "Seed": "Seed",
    "Pixel Type": "Pixeltyp",
    "Workers": "Prozesse",
    "Format": "Format",
    "Lights": "Lichter",
    "Mask": "Maske",
    "Response": "Kennlinie",
    "Bracket": "Belichtungsreihe",
    "Focal": "Brennweite",
    "Chrome": "Spiegelkugel",
    "Gray": "Graue Kugel",
    "Method": "Verfahren",
    "Bases": "Basen",
    "Colour": "Farbe",
    "Start": "Beginn",
    "Rounds": "Runden",
    "Held Out": "Zurückgehalten",
    "Checkerboard": "Schachbrett",
    "Corners": "Ecken",
    "Lamps": "Lampen",
    "Strengths": "Stärken",
    "Cues": "Hinweise",
    "Known Lights": "Bekannte Lichter",
    "Proxy": "Grobes Netz",
    "Interreflections": "Licht zwischen Flächen",
    "Objective": "Zielfunktion",
    "Min Lit": "Wenigste Lichter",
    "Candidates": "Kandidaten",
    "Fuse": "Verschmelzen",
    "Memory": "Speicher",
    "Model": "Modell",
    "Clusters": "Gruppen von Rauheiten",
    "Lobes": "Keulen",
    "Principled": "Principled",
    "Textures": "Texturen",
    "Back": "Rückseite",
    "Keep": "Behalten",
    "Interpolation": "Interpolation",
    "Groups": "Gruppen",
    "Budget": "Zeitbudget",
    "Target": "Ziel",
    "Levels": "Stufen",
    "Unknown Lamps": "Unbekannte Lampen",
    "Known": "Bekannt",
    "Thresholds": "Schwellen",
    "Turn": "Drehung",
    "Bounces": "Reflexionen",
    # What can be chosen
    "Auto": "Automatisch",
    "Direct": "Nur direkt",
    "Full": "Alles",
    "Float": "32 Bit",
    "Half": "16 Bit",
    "Materials": "Materialien",
    "Collections": "Sammlungen",
    "Objects": "Objekte",
    "All": "Alle",
    "Diffuse": "Diffus",
    "Mirror": "Spiegel",
    "Plastic": "Kunststoff",
    "Diffuse Specular": "Diffus und spiegelnd",
    "Isotropic": "Isotrop",
    "Anisotropic": "Anisotrop",
    "Joint": "Gemeinsam",
    "Source": "Wie die Quelle",
    "Packed": "In der Datei",
    "Beside": "Daneben",
    "Open": "Offen",
    "Closed": "Geschlossen",
    "Folder": "Ordner",
    "Near": "Nah",
    "Stack": "Stapel",
    "Uncalibrated": "Unbekannte Lichter",
    "Bivariate": "Bivariat",
    "Double Sphere": "Doppelkugel",
    "Lambertian": "Lambertsch",
    "Weights": "Gewichte",
    "Lobe": "Keule",
    "Symmetry": "Symmetrie",
    "Distant": "Fern",
    "Similar": "Ähnlich",
    "Equal": "Gleich",
    "Unknown": "Unbekannt",
    "noise": "Rauschen",
    "depth error": "Tiefenfehler",
    "normal error": "Normalenfehler",
    "reflectance error": "Reflexionsfehler",
    "picture error": "Bildfehler",
    "error": "Fehler",
}


def register() -> None:
    """Give Blender the translations."""
    words = {(context, key): german for key, german in GERMAN.items() for context in CONTEXTS}
    bpy.app.translations.register(__package__, {"de_DE": words, "de": words})


def unregister() -> None:
    """Take them back."""
    bpy.app.translations.unregister(__package__)
