/* Segmentations through ITK's image readers.
 *
 * The reader is chosen by the file's extension and made here, so ITK's factories, which load
 * every format and look into the environment, are not used.  ITK gives LPS for all three
 * formats: it turns NIfTI's RAS and a NRRD's `space` over.
 *
 * NrrdIO keeps its error messages in global lists, niftiio its options, and MetaIO prints to
 * std::cerr: one lock around their calls makes them usable from all threads.  Conversion to
 * labels is outside of it. */
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <mutex>
#include <unistd.h>
#include <vector>
#include <zlib.h>

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include "apsm/adapters.h"
#include "apsm/files.h"
#include "labels.h"

using namespace apsm;

namespace
{

std::mutex itk_lock;

/* Drops what a reader prints while it lives.  Held under itk_lock. */
class quiet
{
  public:
    quiet() : saved_(std::cerr.rdbuf(nullptr)) { itk::Object::SetGlobalWarningDisplay(false); }
    ~quiet()
    {
        std::cerr.rdbuf(saved_);
        std::cerr.clear();
    }
    quiet(const quiet &) = delete;
    quiet &operator=(const quiet &) = delete;

  private:
    std::streambuf *saved_;
};

struct format {
    const char *extension;
    itk::ImageIOBase::Pointer (*make)();
    bool detached; /* the voxels are in another file */
};

template <class IO> itk::ImageIOBase::Pointer make_io()
{
    return IO::New().GetPointer();
}

const format formats[] = {
    { ".nrrd", make_io<itk::NrrdImageIO>, false },    { ".nhdr", make_io<itk::NrrdImageIO>, true },
    { ".nii.gz", make_io<itk::NiftiImageIO>, false }, { ".nii", make_io<itk::NiftiImageIO>, false },
    { ".mha", make_io<itk::MetaImageIO>, false },     { ".mhd", make_io<itk::MetaImageIO>, true },
};

const format &format_of(const std::string &path)
{
    std::string lower = path;
    for (char &c : lower)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    for (const format &f : formats) {
        const std::string end = f.extension;
        if (lower.size() > end.size() &&
            lower.compare(lower.size() - end.size(), end.size(), end) == 0)
            return f;
    }
    throw failure{ APSM_ERR_UNSUPPORTED,
                   "not an image format known here; use .nrrd, .nii, .nii.gz or .mha" };
}

/* Deflate shrinks at most 1032 times, so a header that promises more voxels than that lies, and
 * memory for it must not be asked for. */
void check_size(const apsm_volume &volume, const itk::ImageIOBase &io, const std::string &path,
                bool detached)
{
    std::error_code error;
    double bytes = static_cast<double>(io.GetComponentSize());
    for (size_t c = 0; c < 3; c++) {
        if (volume.n[c] == 0) damaged("has no voxels; export it again");
        bytes *= static_cast<double>(volume.n[c]);
    }
    const double held =
        detached ? 1e8 : static_cast<double>(std::filesystem::file_size(path, error));
    if (bytes > 1040.0 * held + 65536.0)
        damaged("its header promises more voxels than the file can hold; export it again");
}

/* A value of a NIfTI-1 header, whose byte order shows in its first value, 348 = 256 + 92. */
template <class T> T nifti_value(const std::vector<char> &header, size_t at)
{
    T value;
    char raw[sizeof value];
    for (size_t b = 0; b < sizeof value; b++)
        raw[b] = header[at + (header[0] == 92 ? b : sizeof value - 1 - b)];
    std::memcpy(&value, raw, sizeof value);
    return value;
}

/* Where the last voxel of a NIfTI-1 file ends. */
double nifti_size(const std::vector<char> &header)
{
    const int dimensions = nifti_value<int16_t>(header, 40);
    double voxels = 1.0;
    if (nifti_value<int32_t>(header, 0) != 348 || dimensions < 1 || dimensions > 7)
        damaged("has no NIfTI-1 header; export it again");
    for (int d = 1; d <= dimensions; d++) {
        const int n = nifti_value<int16_t>(header, 40 + 2 * static_cast<size_t>(d));
        if (n < 1) damaged("has " + std::to_string(n) + " voxels along an axis; export it again");
        voxels *= n;
    }
    const int type = nifti_value<int16_t>(header, 70), bits = nifti_value<int16_t>(header, 72);
    const struct {
        int type, bits;
    } known[] = { { 2, 8 },   { 4, 16 },   { 8, 32 },   { 16, 32 },   { 64, 64 },
                  { 256, 8 }, { 512, 16 }, { 768, 32 }, { 1024, 64 }, { 1280, 64 } };
    for (const auto &k : known)
        if (k.type == type && k.bits == bits)
            return static_cast<double>(nifti_value<float>(header, 108)) + voxels * bits / 8.0;
    damaged("voxels are of NIfTI type " + std::to_string(type) + "; save them as integers");
}

/* Axes a and b (columns of a grid, or of its directions) have to be at right angles: a tilted
 * gantry gives a shear, which ITK takes for a rotation or for nothing. */
void check_angle(const double a[3], const double b[3])
{
    double ab = 0, aa = 0, bb = 0;
    for (int c = 0; c < 3; c++) ab += a[c] * b[c], aa += a[c] * a[c], bb += b[c] * b[c];
    const double cosine = aa > 0 && bb > 0 ? std::fabs(ab) / std::sqrt(aa * bb) : 0;
    if (cosine <= 2e-3) return;
    char degrees[32];
    std::snprintf(degrees, sizeof degrees, "%.1f", std::asin(std::min(cosine, 1.0)) * 57.29578);
    damaged("its axes are sheared by " + std::string(degrees) +
            " degrees (a tilted gantry?); resample it to a grid with right angles");
}

/* grid[3 r + c]: coordinate r of axis c. */
void check_angles(const double grid[9])
{
    const int pairs[3][2] = { { 0, 1 }, { 0, 2 }, { 1, 2 } };
    for (const auto &p : pairs) {
        double a[3], b[3];
        for (int r = 0; r < 3; r++) a[r] = grid[3 * r + p[0]], b[r] = grid[3 * r + p[1]];
        check_angle(a, b);
    }
}

/* ITK's singular value decomposition does not end on numbers whose squares leave the floats. */
void check_nifti_grid(const std::vector<char> &header)
{
    const struct {
        size_t at, count;
        bool used;
    } fields[] = { { 80, 3, true },                                       /* voxel sizes */
                   { 256, 6, nifti_value<int16_t>(header, 252) != 0 },    /* qform */
                   { 280, 12, nifti_value<int16_t>(header, 254) != 0 } }; /* sform */
    for (const auto &f : fields)
        for (size_t k = 0; f.used && k < f.count; k++)
            if (!(std::fabs(nifti_value<float>(header, f.at + 4 * k)) < 1e15f))
                damaged("its grid has no place in space; correct qform and sform in its header");
    double grid[9];
    for (size_t k = 0; k < 9; k++)
        grid[k] = static_cast<double>(nifti_value<float>(header, 280 + 16 * (k / 3) + 4 * (k % 3)));
    if (fields[2].used) check_angles(grid);
}

/* niftiio prints what is wrong with a header, fills up with zeros what a file lacks, and does not
 * look at gzip's check sum: so all of that is looked at before. */
void check_nifti(const std::string &path)
{
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose);
    if (!file) throw failure{ APSM_ERR_IO, "cannot be read; check its name and your right to it" };
    std::vector<char> bytes(1 << 16);
    double wanted = 0.0, total = 0.0;
    for (int n; (n = gzread(file.get(), bytes.data(), static_cast<unsigned>(bytes.size()))) != 0;
         total += n) {
        if (n < 0) damaged("its compressed data are cut short or wrong; copy or export it again");
        if (total > 0.0) continue;
        if (n < 348) break;
        wanted = nifti_size(bytes);
        check_nifti_grid(bytes);
    }
    if (!(wanted >= 348.0) || !(total >= wanted))
        damaged("ends before its last voxel; copy or export it again");
}

/* What of a MetaImage header says where the voxels are. */
struct meta_header {
    bool binary = true, compressed = false;
    double compressed_size = 0.0;
    std::string data_file; /* LOCAL: after the header */
    std::streamoff end = 0;
};

std::string trimmed(const std::string &text)
{
    const char *const blanks = " \t\r";
    const size_t first = text.find_first_not_of(blanks);
    return first == std::string::npos
               ? ""
               : text.substr(first, text.find_last_not_of(blanks) + 1 - first);
}

meta_header read_meta_header(std::istream &file)
{
    meta_header h;
    for (std::string line; h.data_file.empty() && std::getline(file, line);) {
        const size_t sign = line.find_first_of("=:");
        if (sign == std::string::npos) continue;
        const std::string key = trimmed(line.substr(0, sign)),
                          value = trimmed(line.substr(sign + 1));
        const bool yes = !value.empty() && std::strchr("Tt1", value[0]);
        if (line.find("NDims") != std::string::npos) {
            const int dimensions = std::atoi(value.c_str());
            if (dimensions < 1 || dimensions > 10) /* MetaIO would count down for ever */
                damaged("has " + one_line(value.substr(0, 40)) + " dimensions; export it again");
        }
        if (key == "BinaryData") h.binary = yes;
        if (key == "CompressedData") h.compressed = yes;
        if (key == "CompressedDataSize") h.compressed_size = std::atof(value.c_str());
        if (key == "ElementDataFile") h.data_file = value;
    }
    h.end = file.tellg();
    return h;
}

/* The size of what `packed` unpacks to; damaged if it is not whole. */
double inflated_size(std::string packed)
{
    z_stream z{};
    std::vector<char> out(1 << 16);
    if (inflateInit2(&z, 47) != Z_OK) throw std::bad_alloc(); /* 47: zlib or gzip */
    z.next_in = reinterpret_cast<Bytef *>(&packed[0]);
    z.avail_in = static_cast<uInt>(packed.size());
    int state = Z_OK;
    for (double total = 0.0;;) {
        z.next_out = reinterpret_cast<Bytef *>(out.data());
        z.avail_out = static_cast<uInt>(out.size());
        state = inflate(&z, Z_NO_FLUSH);
        total += static_cast<double>(out.size() - z.avail_out);
        if (state == Z_OK && z.avail_out == 0) continue;
        inflateEnd(&z);
        if (state == Z_STREAM_END) return total;
        damaged("its compressed data are cut short or wrong; copy or export it again");
    }
}

/* MetaIO asks for as many bytes as the header says that the compressed voxels take, does not
 * look at their check sum, and leaves voxels that are not there as they are. */
void check_meta(const std::string &path, size_t voxel_bytes, size_t voxels)
{
    namespace fs = std::filesystem;
    std::ifstream file(path, std::ios::binary);
    const meta_header h = read_meta_header(file);
    if (h.data_file == "LIST" || h.data_file.find('%') != std::string::npos)
        damaged("its slices are in many files; save it in one");
    if (h.data_file != "LOCAL") {
        file.close();
        file.open((fs::path(path).parent_path() / h.data_file).string(), std::ios::binary);
        if (!file) damaged("its data file '" + h.data_file + "' is not there; copy both files");
    }
    file.seekg(0, std::ios::end);
    const std::streamoff start = h.data_file == "LOCAL" ? h.end : 0, held = file.tellg() - start;
    double whole = static_cast<double>(held);
    if (h.compressed_size > whole || !(h.compressed_size >= 0.0))
        damaged("its header promises more data than there are; copy or export it again");
    if (h.compressed) {
        std::string packed(static_cast<size_t>(held), '\0');
        file.seekg(start);
        file.read(&packed[0], held);
        whole = inflated_size(std::move(packed));
    }
    const double least =
        h.binary ? static_cast<double>(voxel_bytes) : 2.0 * static_cast<double>(voxels) - 1.0;
    if (whole < least) damaged("ends before its last voxel; copy or export it again");
}

void read_volume(const std::string &path, apsm_volume *volume)
{
    const format &f = format_of(path);
    if (access(path.c_str(), R_OK))
        throw failure{ APSM_ERR_IO, std::string(std::strerror(errno)) +
                                        "; check its name and your right to read it" };
    if (f.make == make_io<itk::MetaImageIO>) {
        std::ifstream header(path, std::ios::binary);
        read_meta_header(header);
    }
    apsm_volume v{};
    std::vector<char> raw;
    itk::ImageIOBase::IOComponentEnum type;
    if (f.make == make_io<itk::NiftiImageIO>) check_nifti(path);
    {
        const std::lock_guard<std::mutex> lock(itk_lock);
        const quiet silence;
        const itk::ImageIOBase::Pointer io = f.make();
        if (!io->CanReadFile(path.c_str()))
            damaged(std::string("is not a ") + f.extension +
                    " file, whatever its name says; export it again");
        io->SetFileName(path);
        io->ReadImageInformation();
        grid_of(*io, &v);
        check_size(v, *io, path, f.detached);
        const size_t voxels = v.n[0] * v.n[1] * v.n[2];
        if (f.make == make_io<itk::MetaImageIO>)
            check_meta(path, voxels * io->GetComponentSize(), voxels);
        itk::ImageIORegion region(io->GetNumberOfDimensions());
        for (unsigned d = 0; d < io->GetNumberOfDimensions(); d++)
            region.SetSize(d, io->GetDimensions(d));
        io->SetIORegion(region);
        raw.resize(voxels * io->GetComponentSize());
        type = io->GetComponentType();
        io->Read(raw.data());
    }
    label_array labels = allocate_labels(v.n[0] * v.n[1] * v.n[2]);
    labels_of(type, raw.data(), v.n, labels.get());
    v.label = labels.release();
    *volume = v;
}

template <class T> std::vector<char> components(const apsm_volume &v, size_t n)
{
    std::vector<char> raw(n * sizeof(T));
    T *value = reinterpret_cast<T *>(raw.data());
    for (size_t i = 0; i < n; i++) value[i] = static_cast<T>(v.label[i]);
    return raw;
}

/* A file in the same folder and with the same extension, which tells the writer its format;
 * gone at the end unless it was renamed. */
struct temporary_file {
    explicit temporary_file(const std::string &path)
    {
        const size_t base = path.rfind('/') + 1; /* 0 if there is no slash */
        name = path.substr(0, base) + "." + std::to_string(getpid()) + "-" + path.substr(base);
    }
    ~temporary_file() { unlink(name.c_str()); }
    temporary_file(const temporary_file &) = delete;
    temporary_file &operator=(const temporary_file &) = delete;

    std::string name;
};

void write_volume(apsm_context *ctx, const std::string &path, const apsm_volume &v)
{
    using kind = itk::ImageIOBase::IOComponentEnum;
    const format &f = format_of(path);
    if (f.detached)
        throw failure{ APSM_ERR_UNSUPPORTED,
                       "headers of their own are only read; use .mha or .nrrd" };
    const size_t n = v.n[0] * v.n[1] * v.n[2];
    const auto range = std::minmax_element(v.label, v.label + n);
    const bool small = n == 0 || (*range.first >= 0 && *range.second <= 255);
    const std::vector<char> raw = small ? components<unsigned char>(v, n) : components<int>(v, n);
    const temporary_file temporary(path);
    {
        const std::lock_guard<std::mutex> lock(itk_lock);
        const quiet silence;
        const itk::ImageIOBase::Pointer io = f.make();
        io->SetFileName(temporary.name);
        io->SetNumberOfDimensions(3);
        itk::ImageIORegion region(3);
        for (unsigned c = 0; c < 3; c++) {
            io->SetDimensions(c, v.n[c]);
            io->SetSpacing(c, v.spacing[c]);
            io->SetOrigin(c, v.origin[c]);
            io->SetDirection(
                c, std::vector<double>{ v.direction[c], v.direction[3 + c], v.direction[6 + c] });
            region.SetSize(c, v.n[c]);
        }
        io->SetIORegion(region);
        io->SetPixelType(itk::CommonEnums::IOPixel::SCALAR);
        io->SetNumberOfComponents(1);
        io->SetComponentType(small ? kind::UCHAR : kind::INT);
        io->SetUseCompression(std::string(f.extension) != ".nii");
        io->WriteImageInformation();
        io->Write(raw.data());
    }
    check(apsm_replace_file(ctx, temporary.name.c_str(), path.c_str()));
}

} // namespace

extern "C" apsm_status apsm_itk_read_volume(apsm_context *ctx, const char *path,
                                            apsm_volume *volume)
{
    return guarded(ctx, path, [&] { read_volume(path, volume); });
}

extern "C" apsm_status apsm_itk_write_volume(apsm_context *ctx, const char *path,
                                             const apsm_volume *volume)
{
    return guarded(ctx, path, [&] { write_volume(ctx, path, *volume); });
}
