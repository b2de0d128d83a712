#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "urban_gnss_localization/occlusion/map_file.hpp"

namespace urban_gnss {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

struct MapFile : testing::Test {
  fs::path folder{fs::temp_directory_path() / ("map_file_" + std::to_string(::getpid()))};
  PointCloud map{{1.0F, 2.0F, 3.0F}, {4.0F, 5.0F, 6.0F}};

  MapFile() { fs::create_directory(folder); }
  ~MapFile() override { fs::remove_all(folder); }
  std::string in(const std::string& name) const { return (folder / name).string(); }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
};

TEST_F(MapFile, IsWrittenAndNotOverwrittenUnlessThatIsWanted) {
  save_map_file(in("a.pcd"), map, false);
  EXPECT_EQ(read_pcd(in("a.pcd")).size(), 2u);
  map.push_back({7.0F, 8.0F, 9.0F});
  EXPECT_THROW(save_map_file(in("a.pcd"), map, false), std::runtime_error);
  EXPECT_EQ(read_pcd(in("a.pcd")).size(), 2u);
  save_map_file(in("a.pcd"), map, true);
  EXPECT_EQ(read_pcd(in("a.pcd")).size(), 3u);
  EXPECT_EQ(files(), 1u) << "no remains";
}

// PCL goes on reading its header in the points: it read beyond them.
TEST_F(MapFile, PointsThatLookLikeAHeaderAreRefused) {
  const std::string header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 30\nPOINTS 30\nDATA binary\n";
  const auto write = [&](std::string points) {
    points.resize(360);
    std::ofstream(in("a.pcd"), std::ios::binary) << header << points;
  };
  for (const char* points : {"SIZE 8 8 8\n", "# remark\n\n FIELDS x y\n", "POINTS"}) {
    write(points);
    try {
      read_pcd(in("a.pcd"));
      ADD_FAILURE() << points;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), HasSubstr("a.pcd: is no .pcd file that can be read: its points look like an entry"));
    }
  }
  for (const char* points : {"# \n", "\n\n", "points", "SIZ"}) {
    write(points);
    EXPECT_EQ(read_pcd(in("a.pcd")).size(), 30u) << points;
  }
}

// PCL ends its header there, and looked at a point for which it had no memory.
TEST_F(MapFile, ALineOfSpacesInTheHeaderIsRefused) {
  const std::string header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\n";
  for (const char* line : {" \n", "\t\n", "\r\n", " \v \n"}) {
    std::ofstream(in("a.pcd")) << header << line << "POINTS 1\nDATA ascii\n1 2 3\n";
    try {
      read_pcd(in("a.pcd"));
      ADD_FAILURE() << line;
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("a.pcd: is no .pcd file that can be read: a line of its header is of spaces"));
    }
  }
  std::ofstream(in("a.pcd")) << "\n" << header << "\n\nPOINTS 1\nDATA ascii\n1 2 3\n";
  EXPECT_EQ(read_pcd(in("a.pcd")).size(), 1u) << "empty lines are none of spaces";
}

// PCL made memory for points of the size by the entries that it had seen, and wrote beyond it.
TEST_F(MapFile, AHeaderInAnotherOrderIsRefused) {
  const std::string points = "DATA ascii\n1 2 3 4\n1 2 3 4\n";
  const auto fault_of = [&](const std::string& header) -> std::string {
    std::ofstream(in("a.pcd")) << header << points;
    try {
      read_pcd(in("a.pcd"));
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  const std::string fields = "FIELDS x y z a\n", size = "SIZE 4 4 4 8\n", type = "TYPE F F F F\n";
  EXPECT_EQ(fault_of(fields + size + type + "COUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n"), "");
  EXPECT_EQ(fault_of("# old\nCOLUMNS x y z a\n" + size + type + "POINTS 2\n"), "");
  EXPECT_THAT(fault_of(fields + "POINTS 2\n" + size + type), HasSubstr("SIZE stands behind POINTS in its header"));
  EXPECT_THAT(fault_of(fields + size + type + "POINTS 2\nCOUNT 1 1 1 1\n"), HasSubstr("COUNT stands behind POINTS"));
  EXPECT_THAT(fault_of(size + fields + type + "POINTS 2\n"), HasSubstr("FIELDS stands behind SIZE"));
  EXPECT_THAT(fault_of("FIELDS x\vy z a\n" + size + type + "POINTS 2\n"), HasSubstr("other spaces than PCL takes"));
}

TEST_F(MapFile, OtherPathsAreRefused) {
  EXPECT_THAT(map_file_fault("map.pcd", false), HasSubstr("absolute"));
  EXPECT_THAT(map_file_fault("../map.pcd", false), HasSubstr("absolute"));
  EXPECT_THAT(map_file_fault("", false), HasSubstr("absolute"));
  EXPECT_THAT(map_file_fault(in("map.bag"), false), HasSubstr("must end in .pcd"));
  EXPECT_THAT(map_file_fault(in(".pcd"), false), HasSubstr("must end in .pcd"));
  EXPECT_THAT(map_file_fault("/etc/passwd", true), HasSubstr("must end in .pcd"));
  EXPECT_THAT(map_file_fault(in("a\nb.pcd"), false), HasSubstr("control characters"));
  EXPECT_THAT(map_file_fault(in("a") + std::string("\0.pcd", 5), false), HasSubstr("control characters"));
  EXPECT_THAT(map_file_fault(in("no/a.pcd"), false), HasSubstr("no such folder"));
  EXPECT_THAT(map_file_fault("/" + std::string(5000, 'a') + ".pcd", false), HasSubstr("4095"));
  fs::create_directory(in("folder.pcd"));
  EXPECT_THAT(map_file_fault(in("folder.pcd"), true), HasSubstr("no ordinary file"));
  std::ofstream(in("other.txt")) << "precious";
  fs::create_symlink(in("other.txt"), in("link.pcd"));
  EXPECT_THAT(map_file_fault(in("link.pcd"), true), HasSubstr("no ordinary file"));
  EXPECT_EQ(fs::file_size(in("other.txt")), 8u);
  EXPECT_THROW(save_map_file(in("b.pcd"), {}, false), std::runtime_error);
  EXPECT_FALSE(fs::exists(in("b.pcd")));
}

}  // namespace
}  // namespace urban_gnss
