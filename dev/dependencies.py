#!/usr/bin/env python3
"""Whether each package that the repository uses is declared.

Looks through the whole tree for what others ship: #include, Python imports, nodes and $(find ...) of launch files,
message types, what CMake finds, and programs that shell scripts and Python's subprocess call. Each is to belong to a
package in scripts/apt-debian.txt, and what is used by more than tests to one that package.xml has not for tests only. That
file is a table: Debian's package, its counterpart on Ubuntu with Noetic, and the key in package.xml, with which it is
compared too. On a system that is no Debian, only the table is checked.

Needs no declaration: the standard libraries of C, C++ and Python, the packages that every Debian has (dpkg's
"required"), and a program that its script tells the reader to install, with the words `apt-get install PACKAGE`.
Not seen: programs whose name is put together at run time, those that C++ calls, and the plugins that rviz loads.
Prints what is wrong, with a line for each, and exits with 1 where anything is.
"""
import argparse
import ast
import glob
import os
import re
import subprocess
import sys
import xml.etree.ElementTree
import xml.parsers.expat
from collections import namedtuple

import shell_commands

TABLE = os.path.join("scripts", "apt-debian.txt")
LEFT_OUT = {".git", ".workspace", "results", "__pycache__"}
PYTHON = "/usr/bin/python3"  # Debian's, whichever runs this

# Of kind include, import, node (PACKAGE/TYPE), package, message (PACKAGE/TYPE), cmake or program. One that is not
# `certain`, for it may be an argument, counts where something of its name is installed.
Use = namedtuple("Use", "kind name file line certain")
Row = namedtuple("Row", "debian noetic key line")


# --- the table and package.xml

def read_table(path):
    """The rows of the table, and what is wrong with it."""
    rows, problems, seen = [], [], set()
    with open(path, encoding="utf-8") as stream:
        for number, text in enumerate(stream, 1):
            names = text.split("#")[0].split()
            if not names:
                continue
            place = "%s:%d: " % (TABLE, number)
            if len(names) != 3:
                problems.append(place + "three names are wanted: Debian's package, Noetic's, the key in package.xml")
                continue
            if names[0] in seen:
                problems.append(place + names[0] + " stands here twice")
            seen.add(names[0])
            rows.append(Row(*names, number))
    return rows, problems


def read_package_xml(path):
    """The tags by which package.xml declares each key."""
    keys = {}
    for element in xml.etree.ElementTree.parse(path).getroot():
        if element.tag == "depend" or element.tag.endswith("_depend"):
            keys.setdefault(element.text.strip(), set()).add(element.tag)
    return keys


def compare_with_package_xml(rows, keys):
    """What only one of the table and package.xml has."""
    problems = ["%s:%d: package.xml lacks %s, the key of %s" % (TABLE, row.line, row.key, row.debian)
                for row in rows if row.key != "-" and row.key not in keys]
    known = {row.key for row in rows}
    problems += ["package.xml: %s has no line in %s: add its packages of Debian and of Noetic" % (key, TABLE)
                 for key in keys if key not in known]
    return problems


# --- what files use

def includes(text, file):
    """C++: headers in angles, and in quotes where no such file lies in the tree."""
    for match in re.finditer(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', text, re.M):
        yield Use("include", match.group(2), file, text.count("\n", 0, match.start(2)) + 1, True)


def imports_and_programs(text, file, first_line=1):
    """Python: imported modules, and the programs that subprocess is called with."""
    tree = ast.parse(text, file)
    nodes = list(ast.walk(tree))
    values = {}  # of variables and functions, wherever they are
    for node in nodes:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    values.setdefault(target.id, []).append(node.value)
        elif isinstance(node, ast.FunctionDef):
            values.setdefault(node.name, []).extend(
                each.value for each in ast.walk(node) if isinstance(each, ast.Return) and each.value)

    def words(value, depth=4):
        """The first words of commands that the expression may stand for; None for a word that is not known."""
        if depth == 0:
            return []
        if isinstance(value, (ast.List, ast.Tuple)):
            return [[getattr(each, "value", None) if isinstance(each, ast.Constant) else None for each in value.elts]]
        if isinstance(value, ast.BinOp):
            return words(value.left, depth)
        if isinstance(value, ast.IfExp):
            return words(value.body, depth) + words(value.orelse, depth)
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            return [value.value.split()]
        name = value.func if isinstance(value, ast.Call) else value
        if isinstance(name, ast.Name):
            return [each for known in values.get(name.id, []) for each in words(known, depth - 1)]
        return []

    for node in nodes:
        line = getattr(node, "lineno", 1) + first_line - 1
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Use("import", alias.name, file, line, True)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            for alias in node.names:
                yield Use("import", node.module + "." + alias.name, file, line, True)
        elif isinstance(node, ast.Call) and imported_by_name(node):
            yield Use("import", imported_by_name(node), file, line, True)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args:
            called = "%s.%s" % (getattr(node.func.value, "id", ""), node.func.attr)
            if re.fullmatch(r"subprocess\.\w+|os\.(system|popen|exec\w+|spawn\w+)|shutil\.which", called):
                for command in words(node.args[0]):
                    yield from called_program(command, file, line)


def imported_by_name(call):
    """The module of importlib.import_module("x") or __import__("x"); None for other calls."""
    name = getattr(call.func, "attr", getattr(call.func, "id", None))
    is_import = name in ("import_module", "__import__") and call.args and isinstance(call.args[0], ast.Constant)
    return call.args[0].value if is_import and isinstance(call.args[0].value, str) else None


def cmake_packages(text, file):
    """CMake: what find_package wants, catkin's components, and the packages of messages that ours are made of."""
    text = re.sub(r"#[^\n]*", "", text)
    lists = {match.group(1): match.group(2).split() for match in re.finditer(r"\bset\((\w+)\s+([^()\"]*)\)", text)}
    for match in re.finditer(r"\b(find_package|generate_messages)\s*\(([^()]*)\)", text):
        words = [part for word in match.group(2).split()
                 for part in (lists.get(word[2:-1], []) if word.startswith("${") else [word])]
        names = words[1:] if match.group(1) == "generate_messages" else words[:1]
        if words[:1] == ["catkin"] and "COMPONENTS" in words:
            names += words[words.index("COMPONENTS") + 1:]
        for name in names:
            yield Use("cmake", name, file, text.count("\n", 0, match.start()) + 1, True)


def called_program(words, file, line):
    """The program of a command, and the node that rosrun is told."""
    if words and isinstance(words[0], str) and "/" not in words[0]:
        yield Use("program", words[0], file, line, True)
        if words[0] == "rosrun" and len(words) > 2 and all(isinstance(each, str) for each in words[1:3]):
            yield Use("node", "/".join(words[1:3]), file, line, True)


BUILTINS = set("""
    . : [ [[ alias bg bind break builtin caller case cd command compgen complete continue declare dirs disown echo
    enable eval exec exit export false fc fg for function getopts hash help history jobs kill let local logout mapfile
    popd printf pushd pwd read readarray readonly return select set shift shopt source suspend test times trap true
    type typeset ulimit umask unalias unset wait""".split())
WRAPPERS = {"builtin", "chroot", "command", "env", "eval", "exec", "nice", "nohup", "setsid", "stdbuf", "sudo",
            "timeout", "unshare", "xargs", "xvfb-run"}
ASSUMED = {"sudo"}  # who has none is root, or is told so
PROGRAM = re.compile(r"[A-Za-z][\w.+-]*")


def programs(text, file, functions, first_line=1):
    """Shell: programs that are called, and what Python within the script imports."""
    def external(name):
        return PROGRAM.fullmatch(name) and name not in BUILTINS and name not in functions

    for command in shell_commands.read(text, first_line)[0]:
        name = command.name()
        words = [word.text if word.literal else None for word in command.words]
        if name and external(name):
            yield from called_program(words, file, command.line)
        if name in ("for", "case", "command") and (name != "command" or "-v" in words):
            continue
        if name is None or name in WRAPPERS or name in functions:
            for word in command.words[1:]:
                if word.plain and external(word.text):
                    yield Use("program", word.text, file, command.line, False)
        for before, option, script in zip(words, words[1:], words[2:]):
            if option == "-c" and script and before in ("bash", "sh"):
                yield from programs(script, file, functions, command.line)
            elif option == "-c" and script and before == "python3":
                yield from imports_and_programs(script, file, command.line)
        if name == "trap" and len(words) > 1 and words[1]:
            yield from programs(words[1], file, functions, command.line)
        if "python3" in words and command.documents:
            yield from imports_and_programs(command.documents[0], file, command.line + 1)


def launched(text, file):
    """Launch files: nodes, $(find ...), and programs before or instead of a node."""
    found = []
    parser = xml.parsers.expat.ParserCreate()

    def choices(value):
        """What a value may be: itself, the texts in $(eval ...), or nothing where an argument decides."""
        return re.findall(r"'([^']*)'", value) if "$(eval" in value else [] if "$(" in value else [value]

    def element(tag, attributes):
        line = parser.CurrentLineNumber
        for value in attributes.values():
            for package in re.findall(r"\$\(find\s+(\w+)\s*\)", value):
                found.append(Use("package", package, file, line, True))
        if tag in ("node", "test"):
            types = choices(attributes.get("type", ""))
            for package in choices(attributes.get("pkg", "")):
                name = package + "/" + "|".join(types) if types else package
                found.append(Use("node" if types else "package", name, file, line, True))
            if attributes.get("launch-prefix", "").split():
                found.extend(called_program(attributes["launch-prefix"].split(), file, line))
            for package in re.findall(r"\bload\s+(\w+)/", attributes.get("args", "")):
                found.append(Use("package", package, file, line, True))
        elif tag == "param" and "$(" not in attributes.get("command", "$("):
            found.extend(called_program(attributes["command"].split(), file, line))

    parser.StartElementHandler = element
    parser.Parse(text.encode(), True)
    return found


def message_types(text, file):
    """Messages and services: the types of other packages."""
    for number, line in enumerate(text.splitlines(), 1):
        match = re.match(r"\s*(?:(\w+)/)?(\w+)(?:\[\d*\])?\s+\w+", line)
        if match and (match.group(1) or match.group(2) == "Header"):
            yield Use("message", "%s/%s" % (match.group(1) or "std_msgs", match.group(2)), file, number, True)


# --- the tree

def read_files(root):
    """All text files, by their path in the tree."""
    files = {}
    for folder, folders, names in os.walk(root):
        folders[:] = sorted(name for name in folders if name not in LEFT_OUT)
        for name in sorted(names):
            path = os.path.join(folder, name)
            if os.path.isfile(path):
                try:
                    with open(path, encoding="utf-8") as stream:
                        files[os.path.relpath(path, root)] = stream.read()
                except UnicodeDecodeError:
                    pass  # a picture
    return files


def language(path, text):
    """The language of a file, by its name or its first line; None for one that uses nothing."""
    extension = os.path.splitext(path)[1]
    if os.path.basename(path) == "CMakeLists.txt" or extension == ".cmake":
        return "cmake"
    first = text.split("\n", 1)[0]
    if extension in (".cpp", ".cc", ".c", ".hpp", ".hh", ".h"):
        return "c++"
    if extension == ".py" or first.startswith("#!") and "python" in first:
        return "python"
    if extension in (".sh", ".bash") or re.match(r"#!.*\b(ba|da)?sh\b", first):
        return "shell"
    return {".launch": "launch", ".test": "launch", ".msg": "message", ".srv": "message"}.get(extension)


def uses_of(files):
    """What the files use, without what is theirs."""
    package = xml.etree.ElementTree.fromstring(files["package.xml"].encode()).findtext("name").strip()
    languages = {path: language(path, text) for path, text in files.items()}
    modules, functions, uses = {package}, set(), []
    for path in files:
        if languages[path] == "python":
            name = os.path.splitext(path)[0]
            modules.add(os.path.basename(os.path.dirname(path) if name.endswith("__init__") else name))
        elif languages[path] == "shell":
            functions |= shell_commands.read(files[path])[1]
    headers = ["/" + path for path in files if languages[path] == "c++"]
    for path, text in files.items():
        kind = languages[path]
        if kind == "c++":
            found = [use for use in includes(text, path) if not any(each.endswith("/" + use.name) for each in headers)]
        elif kind == "python":
            found = [use for use in imports_and_programs(text, path) if use.name.split(".")[0] not in modules]
        elif kind == "shell":
            found = programs(text, path, functions)
        elif kind == "launch":
            found = launched(text, path)
        elif kind == "message":
            found = message_types(text, path)
        elif kind == "cmake":
            found = cmake_packages(text, path)
        else:
            continue
        uses += [use for use in found if use.kind == "program" or use.name.split("/")[0] != package]
    return uses


# --- Debian

class Debian:
    """Which installed package ships a file."""

    # The compiler's, the interpreter's and CMake's own.
    STANDARD = re.compile(r"libc6-dev|linux-libc-dev|libstdc\+\+-\d+-dev|libgcc-\d+-dev|"
                          r"(lib)?python3(\.\d+)?-(stdlib|minimal)|cmake-data")
    ONLY_TEXTS = re.compile(r"/\.|/usr(/share)?|/usr/share/(doc|man|lintian|bug|build-essential)(/.*)?|")

    def __init__(self, uses):
        self.modules = self._modules({use.name for use in uses if use.kind == "import"})
        patterns = ("/usr/include", "/usr/include/*-linux-gnu*", "/usr/include/c++/*",
                    "/usr/include/*-linux-gnu*/c++/*", "/usr/lib/gcc/*/*/include", "/usr/include/eigen3",
                    "/usr/include/pcl-*")
        self.include_folders = [folder for pattern in patterns for folder in sorted(glob.glob(pattern))]
        paths = {use: self._paths(use) for use in uses}
        owners = self._owners({path for candidates in paths.values() for path in candidates})
        self.packages = {use: next((owners[path] for path in candidates if path in owners), set())
                         for use, candidates in paths.items()}
        self.found = {use for use, candidates in paths.items() if candidates}
        known = [(name, *rest.split()) for name, rest in self._query("${Package} ${db:Status-Status} ${Priority}")]
        self.installed = {name for name, status, *_ in known if status == "installed"}
        self.required = {name for name, _, *priority in known if priority == ["required"]}

    @staticmethod
    def here():
        """Whether this is a Debian that has ROS from Debian."""
        try:
            with open("/etc/os-release", encoding="utf-8") as stream:
                debian = re.search(r'^ID="?debian"?$', stream.read(), re.M)
        except OSError:
            return False
        return bool(debian) and os.path.exists("/usr/bin/dpkg") and not os.path.isdir("/opt/ros/noetic")

    @staticmethod
    def _query(form, *packages):
        done = subprocess.run(["dpkg-query", "-W", "-f", form + "\n", *packages], stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL, universal_newlines=True)
        return [line.split(" ", 1) for line in done.stdout.splitlines() if " " in line]

    @staticmethod
    def _modules(names):
        """The file of each module, found without importing anything: by the first part's name, then by folders."""
        finder = ("import importlib.util, sys\n"
                  "for name in sys.argv[1:]:\n"
                  "    spec = importlib.util.find_spec(name)\n"
                  "    if spec: print(name, spec.origin or '-', *(spec.submodule_search_locations or []), sep='\\t')\n")
        done = subprocess.run([PYTHON, "-I", "-c", finder, *sorted({name.split(".")[0] for name in names})],
                              stdout=subprocess.PIPE, universal_newlines=True, check=True)
        top = {line.split("\t")[0]: line.split("\t")[1:] for line in done.stdout.splitlines()}
        modules = {}
        for name in names:
            first, *rest = name.split(".")
            if first not in top:
                continue
            file, folders = top[first][0], top[first][1:]
            for part in rest:
                inner = [path for folder in folders for path in
                         [os.path.join(folder, part, "__init__.py"), os.path.join(folder, part + ".py")]
                         + glob.glob(os.path.join(folder, part + ".*.so")) if os.path.exists(path)]
                if not inner:
                    break
                file, folders = inner[0], [os.path.join(folder, part) for folder in folders]
            modules[name] = file
        return modules

    def _paths(self, use):
        """Files that would serve the use, as dpkg may know them."""
        if use.kind == "include":
            found = [os.path.join(folder, use.name) for folder in self.include_folders]
            found.append(os.path.join("/usr/include", use.name.split("/")[0], use.name))  # as pluginlib has it
        elif use.kind == "import":
            module = self.modules.get(use.name, "")
            found = ["/usr/bin/python3"] if module in ("built-in", "frozen") else [module]
        elif use.kind == "node":
            package, types = use.name.split("/")
            found = [os.path.join(folder, package, each) for each in types.split("|")
                     for folder in ("/usr/lib", "/usr/share")]
        elif use.kind == "package":
            found = [os.path.join("/usr/share", use.name, "package.xml")]
        elif use.kind == "cmake":
            found = [path for name in (use.name, use.name.lower()) for folder in
                     ("/usr/share/%s/cmake", "/usr/lib/*/cmake/%s*", "/usr/lib/cmake/%s*", "/usr/share/cmake/%s*",
                      "/usr/share/cmake-*/Modules")
                     for file in (use.name + "Config", name + "-config", "Find" + use.name)
                     for path in glob.glob(os.path.join(folder.replace("%s", name), file + ".cmake"))]
        elif use.kind == "message":
            package, name = use.name.split("/")
            found = [os.path.join("/usr/share", package, "msg", name + ".msg")]
        else:
            found = [os.path.join(folder, use.name) for folder in ("/usr/bin", "/usr/sbin", "/usr/games")]
        found = [os.path.normpath(path) for path in found if os.path.isfile(path)]
        # /bin is a link to /usr/bin, and dpkg knows a file by either; alternatives are links to what a package ships.
        found += [os.path.realpath(path) for path in found]
        return found + [path[len("/usr"):] for path in found if path.startswith("/usr/")]

    @staticmethod
    def _owners(paths):
        done = subprocess.run(["dpkg", "-S", *sorted(paths)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              universal_newlines=True)
        owners = {}
        for line in done.stdout.splitlines():
            names, _, path = line.partition(": ")
            if not line.startswith("diversion by "):
                owners.setdefault(path, set()).update(name.split(":")[0] for name in names.split(", "))
        return owners

    def standard(self, packages):
        """Whether one of the packages needs no declaration."""
        return any(name in self.required or self.STANDARD.fullmatch(name) for name in packages)

    def absent(self, listed):
        """The listed packages that are not installed."""
        return sorted(set(listed) - self.installed)

    def covered(self, listed):
        """The listed packages, and what those bring that ship nothing of their own, as libboost-dev."""
        covered = set(listed)
        packages = sorted(self.installed & set(listed))
        for name, depends in self._query("${Package} ${Depends}", *packages) if packages else []:  # none would be all
            done = subprocess.run(["dpkg", "-L", name], stdout=subprocess.PIPE, universal_newlines=True)
            if all(self.ONLY_TEXTS.fullmatch(path) for path in done.stdout.splitlines()):
                covered.update(re.findall(r"(?:^|[,|])\s*([a-z0-9][a-z0-9.+-]+)", depends))
        return covered


# --- the check

def undeclared(uses, files, listed, system):
    """A line for each use without a declared package. `system` is Debian, or what stands for it in a test."""
    covered, told, places = system.covered(listed), {}, {}
    for use in uses:
        packages = system.packages.get(use, set())
        if use.name in ASSUMED or system.standard(packages) or packages & covered:
            continue
        if use.file not in told:
            by_hand = re.findall(r"apt-get install ([a-z0-9.+ -]+)", files[use.file])
            told[use.file] = system.covered(" ".join(by_hand).split())
        if use.kind == "program" and (told[use.file] & packages or told[use.file] and use not in system.found):
            continue  # its package, perhaps, is told to be installed by hand
        if not packages and not use.certain:
            continue
        what = "%s %s" % (use.kind, use.name)
        if packages:
            text = what + " is shipped by %s, which %s lacks: add a line there, and its key to package.xml" % (
                " or ".join(sorted(packages)), TABLE)
        elif use in system.found:
            text = what + " is installed, but no package ships it: take one that a package ships"
        else:
            text = what + " is in no package that is installed here: install the one that ships it (apt-file search " \
                "finds it), add its line to %s and its key to package.xml, or do without" % TABLE
        places.setdefault(text, []).append("%s:%d" % (use.file, use.line))
    absent = system.absent(listed)
    if places and absent:
        places["listed, but not installed here, so that nobody knows what they ship: %s; scripts/setup.sh installs them"
               % " ".join(absent)] = [TABLE]
    return ["%s: %s" % (", ".join(where[:3]) + (" and %d more" % (len(where) - 3) if len(where) > 3 else ""), text)
            for text, where in places.items()]


TESTS = ("test/", "benchmark/", "dev/", "CMakeLists.txt")  # where what is declared for tests only may be used


def only_for_tests(uses, rows, keys, system):
    """A line for each use outside of the tests of a package that package.xml declares for tests only."""
    places = {}
    for use in uses:
        if use.file.startswith(TESTS):
            continue
        declared = {row.key: keys[row.key] for row in rows
                    if row.key in keys and row.debian in system.packages.get(use, set())}
        if declared and all(tags == {"test_depend"} for tags in declared.values()):
            text = "%s %s is used here, but package.xml has %s for tests only (test_depend)" % (
                use.kind, use.name, " and ".join(sorted(declared)))
            places.setdefault(text, []).append("%s:%d" % (use.file, use.line))
    return ["%s: %s" % (", ".join(where[:3]), text) for text, where in places.items()]


def check(root, system_of=None):
    """What is wrong in the tree. `system_of` makes the system from the uses; without it only the table is checked."""
    files = read_files(root)
    rows, problems = read_table(os.path.join(root, TABLE))
    keys = read_package_xml(os.path.join(root, "package.xml"))
    problems += compare_with_package_xml(rows, keys)
    if system_of:
        uses = uses_of(files)
        system = system_of(uses)
        problems += undeclared(uses, files, [row.debian for row in rows], system)
        problems += only_for_tests(uses, rows, keys, system)
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", default=os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."),
                        help="the repository (default: the one this file is in)")
    parser.add_argument("--list", action="store_true", help="print every use and the packages that ship it")
    options = parser.parse_args()
    if not Debian.here():
        print("dependencies: this is no Debian with ROS from Debian: only the table is checked", file=sys.stderr)
    if options.list:
        uses = uses_of(read_files(options.root))
        packages = Debian(uses).packages
        for use in sorted(uses):
            print("%s:%d: %s %s: %s" % (use.file, use.line, use.kind, use.name, " ".join(sorted(packages[use])) or "-"))
        return
    problems = check(options.root, Debian if Debian.here() else None)
    for problem in problems:
        print(problem)
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
